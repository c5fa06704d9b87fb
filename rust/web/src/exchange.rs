//! The memory that a page writes requests to and reads answers from.

use std::cell::RefCell;

use deadtime::Error;

use crate::request::Request;

#[derive(Default)]
struct Exchange {
    request: Vec<f64>,
    answer: Vec<f64>,
    message: String,
}

thread_local! {
    static EXCHANGE: RefCell<Exchange> = RefCell::default();
}

pub(crate) fn reserve(count: usize) -> *mut f64 {
    EXCHANGE.with_borrow_mut(|exchange| {
        exchange.request.clear();
        exchange.request.resize(count, f64::NAN);
        exchange.request.as_mut_ptr()
    })
}

pub(crate) fn answer() -> (*const f64, usize) {
    EXCHANGE.with_borrow(|exchange| (exchange.answer.as_ptr(), exchange.answer.len()))
}

pub(crate) fn message() -> (*const u8, usize) {
    EXCHANGE.with_borrow(|exchange| (exchange.message.as_ptr(), exchange.message.len()))
}

/// Read the request, and keep the answer of `work` or the reason why there is none.
pub(crate) fn answered(work: impl FnOnce(&mut Request<'_>) -> Result<Vec<f64>, Error>) -> bool {
    EXCHANGE.with_borrow_mut(|exchange| {
        let found = work(&mut Request::new(&exchange.request));
        let (answer, message) = match found {
            Ok(answer) => (answer, String::new()),
            Err(error) => (Vec::new(), error.to_string()),
        };
        exchange.answer = answer;
        exchange.message = message;
        exchange.message.is_empty()
    })
}
