//! Files of a run.
