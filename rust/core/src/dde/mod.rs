//! (room dde)
