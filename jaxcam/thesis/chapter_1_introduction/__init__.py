"""Chapter 1: an introduction to chatter in two figures."""
