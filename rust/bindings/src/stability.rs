//! Bindings of `deadtime::stability`.
