"""The atlas, and the poses estimated with it."""
