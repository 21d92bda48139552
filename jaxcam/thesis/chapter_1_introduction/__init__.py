"""Chapter 1: what chatter is, in two figures."""
