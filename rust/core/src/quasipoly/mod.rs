//! (room quasipoly)
