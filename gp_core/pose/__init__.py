"""The pose of a cochlea, estimated from touched points."""
