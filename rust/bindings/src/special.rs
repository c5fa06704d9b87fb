//! Bindings of `deadtime::lambertw`.
