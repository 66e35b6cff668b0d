"""The equations of motion between events, compiled: flow, contacts, modes, the past of delays."""
