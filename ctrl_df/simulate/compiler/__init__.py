"""Machine code: how functions are compiled, kept, called by address, and waited for."""
