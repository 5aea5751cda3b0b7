"""The thesis' agents: nine networks a joint, learned step by step (chapter 4)."""
