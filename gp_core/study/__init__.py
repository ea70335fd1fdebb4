"""The study: leave-one-out, subset search, simulation, physical test, figures."""
