"""The bound: what can be achieved on a virtual arm at all, by plans in its true physics."""
