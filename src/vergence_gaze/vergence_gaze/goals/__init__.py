"""Goals: what can be requested, how a request becomes a target, and how it ends."""
