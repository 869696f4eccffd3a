"""Task allocation: divides a route's stops among robots that drive at once, or among tours within a time."""
