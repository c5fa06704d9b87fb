//! (room roots)
