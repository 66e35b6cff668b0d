"""Blocks of one signal element: memoryless laws, and those with hysteresis."""
