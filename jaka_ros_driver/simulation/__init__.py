"""The simulated controller: motion of the arm (plant), state machine, wire, faults."""
