"""The window without a display, driven by a script: `script`, `runner`, `batch`, `demo`."""
