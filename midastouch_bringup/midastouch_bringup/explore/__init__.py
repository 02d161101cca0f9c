"""A simulated finger that explores an object until the filter knows where it is; what comes out, and its page."""
