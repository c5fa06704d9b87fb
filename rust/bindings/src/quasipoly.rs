//! Bindings of `deadtime::quasipoly`.
