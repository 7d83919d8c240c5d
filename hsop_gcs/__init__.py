"""The HSOP ground-control service: reports → tracks → placement → assignment → mission → link."""
