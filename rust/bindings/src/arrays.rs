//! Arrays across the seam: borrowed where their memory allows it, gathered where it does not.

use std::borrow::Cow;

use numpy::ndarray::ArrayViewD;
use numpy::{Element, PyReadonlyArrayDyn, PyUntypedArrayMethods};

/// The elements in C order: a borrow when they lie so in memory, a gathered copy otherwise.
pub(crate) fn in_order<'a, T: Element + Copy>(
    array: &'a PyReadonlyArrayDyn<'_, T>,
) -> Cow<'a, [T]> {
    // `as_slice` also serves Fortran order, where memory order is not C order.
    match array.as_slice() {
        Ok(slice) if array.is_c_contiguous() => Cow::Borrowed(slice),
        _ => Cow::Owned(view(array).iter().copied().collect()),
    }
}

fn view<'a, T: Element>(array: &'a PyReadonlyArrayDyn<'_, T>) -> ArrayViewD<'a, T> {
    array.as_array()
}
