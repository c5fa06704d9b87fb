//! (room lambertw)
