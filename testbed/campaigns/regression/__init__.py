"""The standard campaign: how every filter does on the same cases, against what is stored and against the others."""
