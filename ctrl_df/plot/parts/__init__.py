"""What every picture is made of: the page, its labels, curves and events."""
