//! Right-hand sides that are C functions, called a node at a time without the interpreter.
#![allow(unsafe_code)]

use std::ffi::c_void;

use deadtime::dde::spectral::{Columns, Equation};
use deadtime::{Error, Task};
use pyo3::prelude::*;

use super::functions::Failing;

/// t, y, z (delay, component), dz likewise, dy, user data.
type Function =
    unsafe extern "C" fn(f64, *const f64, *const f64, *const f64, *mut f64, *mut c_void);

/// Nodes between two checks for an interruption.
const CHECK_EVERY: usize = 8;

/// The address of a [`Function`] and of its user data.
pub(super) struct CompiledEquation {
    function: usize,
    data: usize,
    /// Arguments of one node.
    y: Vec<f64>,
    z: Vec<f64>,
    dz: Vec<f64>,
    dy: Vec<f64>,
}

impl CompiledEquation {
    pub(super) fn new(function: usize, data: usize) -> Self {
        Self {
            function,
            data,
            y: Vec::new(),
            z: Vec::new(),
            dz: Vec::new(),
            dy: Vec::new(),
        }
    }
}

/// Gather one node of (row, node).
fn gather(values: &[f64], n: usize, node: usize, out: &mut [f64]) {
    for (out, row) in out.iter_mut().zip(values.chunks_exact(n)) {
        *out = row[node];
    }
}

impl Equation for CompiledEquation {
    fn slope(&mut self, at: Columns<'_>, out: &mut [f64], task: &Task) -> Result<(), Error> {
        let n = at.t.len();
        // SAFETY: the caller says that a function of this signature is at this address.
        let function: Function = unsafe { std::mem::transmute(self.function as *const c_void) };
        let data = self.data as *mut c_void;
        if out.len() == n && at.z.len() <= n && at.dz.len() <= n {
            // One row of each: the arguments lie where the function reads them.
            for (node, (&t, dy)) in at.t.iter().zip(out).enumerate() {
                if node % CHECK_EVERY == 0 {
                    task.check()?;
                }
                let [y, z, dz] = [at.y, at.z, at.dz].map(|row| row[node.min(row.len())..].as_ptr());
                // SAFETY: as below.
                unsafe { function(t, y, z, dz, dy, data) };
            }
            return Ok(());
        }
        self.y.resize(at.y.len() / n, 0.0);
        self.z.resize(at.z.len() / n, 0.0);
        self.dz.resize(at.dz.len() / n, 0.0);
        self.dy.resize(out.len() / n, 0.0);
        for (node, &t) in at.t.iter().enumerate() {
            if node % CHECK_EVERY == 0 {
                task.check()?;
            }
            gather(at.y, n, node, &mut self.y);
            gather(at.z, n, node, &mut self.z);
            gather(at.dz, n, node, &mut self.dz);
            let dy = self.dy.as_mut_ptr();
            let (y, z, dz) = (self.y.as_ptr(), self.z.as_ptr(), self.dz.as_ptr());
            // SAFETY: all arrays have the sizes that the signature promises, and `dz` is not to be
            // read unless the equation is neutral.
            unsafe { function(t, y, z, dz, dy, data) };
            for (row, dy) in out.chunks_exact_mut(n).zip(&self.dy) {
                row[node] = *dy;
            }
        }
        Ok(())
    }
}

impl Failing for CompiledEquation {
    fn failure(&mut self) -> Option<PyErr> {
        None
    }
}
