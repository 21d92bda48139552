"""Chapter 6: chattering and its interruption."""
