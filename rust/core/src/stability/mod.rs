//! (room stability)
