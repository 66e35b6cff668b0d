"""A system as arrays: nodes, their order, their numbers, the addresses of their laws."""
