"""What a sensor is, from a record of it beside a reference: response, noise, and the belief that follows."""
