//! NumPy ufuncs made of block kernels.
//!
//! A ufunc is a line in [`crate::special`]: its name, its operands and, for each combination of
//! types, the kernel. NumPy does the rest (broadcasting, `out`, `where`, `dtype`, casts,
//! subclasses). The loops are of NumPy's newer kind (2.0 on), which can raise an exception, so
//! that a result cut short by Ctrl-C never comes back, and which need not look at floating-point
//! flags, so that none of them warns of an overflow inside a kernel.
#![allow(unsafe_code)]

mod flags;
mod operands;
pub(crate) mod scalar;
mod strided;

use std::ffi::{CStr, c_int, c_void};
use std::marker::PhantomData;

use numpy::npyffi::{
    NPY_ARRAYMETHOD_FLAGS, NPY_CASTING, PY_UFUNC_API, PyArray_DTypeMeta, PyArrayMethod_Spec,
};
use pyo3::exceptions::PyTypeError;
use pyo3::ffi::{PyObject, PyType_Slot};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyCapsule, PyTuple, PyType};

pub(crate) use operands::{Memory, Operands, Type};
pub(crate) use strided::{Loop, limit_threads};

/// A ufunc and its loops; those first in the list are preferred.
pub(crate) trait Ufunc {
    const NAME: &'static CStr;
    const DOC: &'static CStr;
    const INPUTS: usize;
    const OUTPUTS: usize;
    const LOOPS: &'static [LoopEntry];
}

/// What NumPy is told of a loop.
pub(crate) struct LoopEntry {
    types: &'static [Type],
    function: StridedLoop,
}

type StridedLoop = unsafe extern "C" fn(
    *mut c_void,
    *const *mut std::ffi::c_char,
    *const numpy::npyffi::npy_intp,
    *const numpy::npyffi::npy_intp,
    *mut numpy::npyffi::NpyAuxData,
) -> c_int;

impl LoopEntry {
    pub(crate) const fn of<L: Loop>(_: PhantomData<L>) -> Self {
        Self {
            types: L::TYPES,
            function: strided::strided::<L>,
        }
    }
}

/// Define a type for a ufunc: documentation, name, then a line for each loop.
///
/// The types of a line are those of the arrays; the kernel takes slices of its own types, between
/// which and those [`operands::Cast`] converts. All loops of a ufunc have as many operands.
macro_rules! ufunc {
    (
        $(#[doc = $doc:literal])+
        $type:ident = $name:literal, $inputs:literal -> $outputs:literal;
        $(($($in:ident: $from:ty),+) -> ($($out:ident: $to:ty),+) = $kernel:path;)+
    ) => {
        $(#[doc = $doc])+
        struct $type;

        impl $crate::ufunc::Ufunc for $type {
            const NAME: &'static std::ffi::CStr = $name;
            const DOC: &'static std::ffi::CStr = {
                const TEXT: &[u8] = concat!($($doc, "\n",)+ "\0").trim_ascii_start().as_bytes();
                match std::ffi::CStr::from_bytes_with_nul(TEXT) {
                    Ok(text) => text,
                    Err(_) => c"",
                }
            };
            const INPUTS: usize = $inputs;
            const OUTPUTS: usize = $outputs;
            const LOOPS: &'static [$crate::ufunc::LoopEntry] = &[$({
                struct Typed;

                impl $crate::ufunc::Loop for Typed {
                    const TYPES: &'static [$crate::ufunc::Type] = &[
                        $(<$from as $crate::ufunc::Memory>::TYPE,)+
                        $(<$to as $crate::ufunc::Memory>::TYPE,)+
                    ];
                    const INPUTS: usize = $inputs;

                    // The last addition to the count of operands is not read.
                    #[allow(unused_assignments)]
                    fn compute<const N: usize>(
                        operands: &$crate::ufunc::Operands,
                        range: std::ops::Range<usize>,
                    ) {
                        $(let mut $in = [Default::default(); N];)+
                        $(let mut $out = [Default::default(); N];)+
                        for start in range.clone().step_by(N) {
                            let n = N.min(range.end - start);
                            let first = start == range.start;
                            let mut operand = 0;
                            $(
                                operands.gather::<$from, _>(
                                    operand, start, &mut $in[..n], first,
                                );
                                operand += 1;
                            )+
                            $kernel($(&$in[..n],)+ $(&mut $out[..n],)+);
                            $(
                                operands.scatter::<$to, _>(operand, start, &$out[..n]);
                                operand += 1;
                            )+
                        }
                    }
                }

                $crate::ufunc::LoopEntry::of(std::marker::PhantomData::<Typed>)
            },)+];
        }
    };
}
pub(crate) use ufunc;

/// Make the ufunc `U` an attribute of `module`.
pub(crate) fn add<U: Ufunc>(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    // SAFETY: a ufunc without loops; name and documentation live for ever.
    let ufunc = unsafe {
        let made = PY_UFUNC_API.PyUFunc_FromFuncAndData(
            py,
            std::ptr::null_mut(),
            std::ptr::null_mut(),
            std::ptr::null_mut(),
            0,
            U::INPUTS as c_int,
            U::OUTPUTS as c_int,
            NO_IDENTITY,
            U::NAME.as_ptr(),
            U::DOC.as_ptr(),
            0,
        );
        Bound::from_owned_ptr_or_err(py, made)?
    };
    for entry in U::LOOPS {
        add_loop::<U>(&ufunc, entry)?;
    }
    add_promoter::<U>(&ufunc)?;
    module.add(U::NAME.to_string_lossy().as_ref(), ufunc)
}

/// `PyUFunc_None`: no reduction without elements.
const NO_IDENTITY: c_int = -1;

fn add_loop<U: Ufunc>(ufunc: &Bound<'_, PyAny>, entry: &LoopEntry) -> PyResult<()> {
    /// `NPY_METH_strided_loop`
    const STRIDED_LOOP: c_int = 5;
    let py = ufunc.py();
    let classes: Vec<_> = entry.types.iter().map(|t| t.dtype(py).get_type()).collect();
    let mut dtypes: Vec<*mut PyArray_DTypeMeta> =
        classes.iter().map(|class| class.as_type_ptr()).collect();
    let mut slots = [
        PyType_Slot {
            slot: STRIDED_LOOP,
            pfunc: entry.function as *mut c_void,
        },
        PyType_Slot::default(),
    ];
    let mut spec = PyArrayMethod_Spec {
        name: U::NAME.as_ptr(),
        nin: U::INPUTS as c_int,
        nout: U::OUTPUTS as c_int,
        casting: NPY_CASTING::NPY_NO_CASTING,
        flags: NPY_ARRAYMETHOD_FLAGS::NPY_METH_NO_FLOATINGPOINT_ERRORS,
        dtypes: dtypes.as_mut_ptr(),
        slots: slots.as_mut_ptr(),
    };
    type AddLoop = unsafe extern "C" fn(*mut PyObject, *mut PyArrayMethod_Spec) -> c_int;
    // SAFETY: entry 43 of the table is PyUFunc_AddLoopFromSpec, which copies what it needs; the
    // loop is called with operands of the types that stand in the same entry.
    let status = unsafe {
        let add: AddLoop = std::mem::transmute(api(py, 43)?);
        add(ufunc.as_ptr(), &raw mut spec)
    };
    succeeded(py, status)
}

fn add_promoter<U: Ufunc>(ufunc: &Bound<'_, PyAny>) -> PyResult<()> {
    let py = ufunc.py();
    let any = PyTuple::new(py, vec![py.None().into_bound(py); U::INPUTS + U::OUTPUTS])?;
    let promoter = std::ptr::NonNull::new(promote::<U> as *mut c_void)
        .ok_or_else(|| PyTypeError::new_err("no promoter"))?;
    type AddPromoter = unsafe extern "C" fn(*mut PyObject, *mut PyObject, *mut PyObject) -> c_int;
    // SAFETY: entry 44 of the table is PyUFunc_AddPromoter; the capsule holds a promoter and has
    // the name that NumPy looks for.
    let status = unsafe {
        let capsule = PyCapsule::new_with_pointer(py, promoter, c"numpy._ufunc_promoter")?;
        let add: AddPromoter = std::mem::transmute(api(py, 44)?);
        add(ufunc.as_ptr(), any.as_ptr(), capsule.as_ptr())
    };
    succeeded(py, status)
}

fn succeeded(py: Python<'_>, status: c_int) -> PyResult<()> {
    if status < 0 {
        return Err(PyErr::fetch(py));
    }
    Ok(())
}

/// Entry `index` of NumPy's table of functions for ufuncs (43 and up: from 2.0 on).
fn api(py: Python<'_>, index: usize) -> PyResult<*const c_void> {
    static TABLE: PyOnceLock<Py<PyCapsule>> = PyOnceLock::new();
    let table = TABLE.get_or_try_init(py, || {
        let capsule = py.import("numpy._core.umath")?.getattr("_UFUNC_API")?;
        Ok::<_, PyErr>(capsule.cast_into::<PyCapsule>()?.unbind())
    })?;
    let entries = table
        .bind(py)
        .pointer_checked(None)?
        .cast::<*const c_void>();
    // SAFETY: the capsule holds the table and is kept alive; it has the entry, see above.
    Ok(unsafe { entries.add(index).read() })
}

/// Choose the loop for arguments of types that have none of their own.
///
/// The first loop to which all inputs can be cast safely; where types are asked for (`dtype=`,
/// `signature=`), the first that has them, with casts of the same kind.
///
/// # Safety
/// As NumPy promises for a promoter of `U`.
unsafe extern "C" fn promote<U: Ufunc>(
    _ufunc: *mut PyObject,
    given: *const *mut PyArray_DTypeMeta,
    wanted: *const *mut PyArray_DTypeMeta,
    chosen: *mut *mut PyArray_DTypeMeta,
) -> c_int {
    let operands = U::INPUTS + U::OUTPUTS;
    crate::runtime::attached(|py| {
        // SAFETY: both arrays have an entry for each operand, a DType class or null.
        let classes = |array: *const *mut PyArray_DTypeMeta| -> Vec<Option<Bound<'_, PyAny>>> {
            (0..operands)
                .map(|i| unsafe { Bound::from_borrowed_ptr_or_opt(py, array.add(i).read().cast()) })
                .collect()
        };
        match choose::<U>(py, &classes(given), &classes(wanted)) {
            Ok(entry) => {
                for (i, kind) in entry.types.iter().enumerate() {
                    let class: Bound<'_, PyType> = kind.dtype(py).get_type();
                    // SAFETY: an entry for each operand; NumPy takes over the reference.
                    unsafe { chosen.add(i).write(class.into_ptr().cast()) };
                }
                0
            }
            Err(error) => {
                error.restore(py);
                -1
            }
        }
    })
}

fn choose<'py, U: Ufunc>(
    py: Python<'py>,
    given: &[Option<Bound<'py, PyAny>>],
    wanted: &[Option<Bound<'py, PyAny>>],
) -> PyResult<&'static LoopEntry> {
    let asked = wanted.iter().any(Option::is_some);
    let rules: &[&str] = if asked {
        &["safe", "same_kind"]
    } else {
        &["safe"]
    };
    let numpy = py.import("numpy")?;
    for rule in rules {
        'entries: for entry in U::LOOPS {
            for (i, kind) in entry.types.iter().enumerate() {
                let dtype = kind.dtype(py);
                if let Some(class) = &wanted[i] {
                    if !class.is(dtype.get_type()) {
                        continue 'entries;
                    }
                } else if let Some(class) = given[i].as_ref().filter(|_| i < U::INPUTS) {
                    // Of a Python number it is int, float or complex.
                    let scalar = class.getattr("type")?;
                    let castable = numpy.call_method1("can_cast", (scalar, dtype, *rule))?;
                    if !castable.extract::<bool>()? {
                        continue 'entries;
                    }
                }
            }
            return Ok(entry);
        }
    }
    let names = |classes: &[Option<Bound<'py, PyAny>>]| -> PyResult<String> {
        let names: PyResult<Vec<String>> = classes
            .iter()
            .flatten()
            .map(|class| class.getattr("type")?.getattr("__name__")?.extract())
            .collect();
        Ok(names?.join(", "))
    };
    let name = U::NAME.to_string_lossy();
    let types = names(&given[..U::INPUTS])?;
    let asked = names(wanted)?;
    Err(PyTypeError::new_err(if asked.is_empty() {
        format!("{name} does not take arguments of the types ({types})")
    } else {
        format!("{name} has no result of type {asked} for arguments of the types ({types})")
    }))
}
