//! Bindings of `deadtime::dde`.
