//! A request: numbers one after the other, lists with their length before them.

use deadtime::Error;

/// What is left to read.
pub(crate) struct Request<'a> {
    rest: &'a [f64],
}

impl<'a> Request<'a> {
    pub(crate) fn new(numbers: &'a [f64]) -> Self {
        Self { rest: numbers }
    }

    /// The next number.
    ///
    /// # Errors
    /// [`Error::Argument`] at the end of the request.
    pub(crate) fn number(&mut self) -> Result<f64, Error> {
        match self.rest.split_first() {
            Some((number, rest)) => {
                self.rest = rest;
                Ok(*number)
            }
            None => Err(Error::argument("the request ends too early")),
        }
    }

    /// The next number, where that is a whole one from zero on.
    ///
    /// # Errors
    /// As [`number`](Self::number), and for other numbers.
    pub(crate) fn whole(&mut self) -> Result<usize, Error> {
        let number = self.number()?;
        if number >= 0.0 && number.fract() == 0.0 && number < f64::from(u32::MAX) {
            Ok(number as usize)
        } else {
            Err(Error::argument(format!(
                "{number} in a request where a whole number is expected"
            )))
        }
    }

    /// A number that is zero or one.
    ///
    /// # Errors
    /// As [`whole`](Self::whole).
    pub(crate) fn flag(&mut self) -> Result<bool, Error> {
        Ok(self.whole()? != 0)
    }

    /// A list with its length before it.
    ///
    /// # Errors
    /// As [`whole`](Self::whole).
    pub(crate) fn list(&mut self) -> Result<&'a [f64], Error> {
        let count = self.whole()?;
        match self.rest.split_at_checked(count) {
            Some((list, rest)) => {
                self.rest = rest;
                Ok(list)
            }
            None => Err(Error::argument("the request ends inside a list")),
        }
    }
}
