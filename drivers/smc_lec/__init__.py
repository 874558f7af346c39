"""SMC LEC controllers, and the tables that fix what their axes can do."""
