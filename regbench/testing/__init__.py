"""For authors of methods: the conformance battery."""
