"""Every effect fitted: where fits begin, and which of them are completed."""
