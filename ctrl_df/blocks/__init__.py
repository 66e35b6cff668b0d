"""What a thing does in time: effects, mechanisms, memoryless and hysteretic elements, the PID."""
