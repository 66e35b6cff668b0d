"""What `advance` is made of: the parts of a run, each called in one place and copied there."""
