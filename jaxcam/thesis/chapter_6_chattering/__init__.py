"""Chapter 6: chatter and its interruption."""
