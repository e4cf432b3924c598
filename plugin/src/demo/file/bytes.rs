//! Little-endian reading and writing of the values inside a frame.

use super::episode_fault::EpisodeFault;

/// Encodings of a list; the shorter one is used.
const PLAIN: u8 = 0;
const RUNS: u8 = 1;

pub(super) fn malformed(why: impl Into<String>) -> EpisodeFault {
    EpisodeFault::Malformed(why.into())
}

/// A value of fixed size.
pub(super) trait Scalar: Copy {
    /// Size in bytes.
    const SIZE: usize;
    fn put(self, out: &mut Vec<u8>);
    /// Reads the value from exactly `SIZE` bytes.
    fn get(bytes: &[u8]) -> Self;
    /// Compares the bits: runs must return -0.0 as -0.0.
    fn same(self, other: Self) -> bool;
}

macro_rules! scalar {
    ($($type:ty),*) => {$(
        impl Scalar for $type {
            const SIZE: usize = size_of::<$type>();
            fn put(self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
            fn get(bytes: &[u8]) -> Self {
                let mut array = [0; size_of::<$type>()];
                array.copy_from_slice(bytes);
                Self::from_le_bytes(array)
            }
            fn same(self, other: Self) -> bool {
                self.to_le_bytes() == other.to_le_bytes()
            }
        }
    )*};
}
scalar!(u8, u16, u32, u64, f32);

/// Writes the values one after the other, without their number.
pub(super) fn put_plain<T: Scalar>(values: &[T], out: &mut Vec<u8>) {
    out.reserve(values.len() * T::SIZE);
    for &value in values {
        value.put(out);
    }
}

/// Writes the values as runs `(count, value)` or one after the other, whichever is shorter.
pub(super) fn put_list<T: Scalar>(values: &[T], out: &mut Vec<u8>) {
    let start = out.len();
    out.push(RUNS);
    for run in values.chunk_by(|a, b| a.same(*b)) {
        put_varint(run.len() as u64, out);
        run[0].put(out);
    }
    if out.len() - start > 1 + values.len() * T::SIZE {
        out.truncate(start);
        out.push(PLAIN);
        put_plain(values, out);
    }
}

/// Writes a number with seven bits a byte, lowest first.
fn put_varint(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Reads values from the front of a slice. Sizes are checked before memory is allocated.
pub(super) struct Cursor<'a>(pub(super) &'a [u8]);

impl<'a> Cursor<'a> {
    fn take(&mut self, length: usize, what: &str) -> Result<&'a [u8], EpisodeFault> {
        let (head, tail) =
            self.0.split_at_checked(length).ok_or_else(|| malformed(format!("it ends inside {what}")))?;
        self.0 = tail;
        Ok(head)
    }

    pub(super) fn scalar<T: Scalar>(&mut self, what: &str) -> Result<T, EpisodeFault> {
        Ok(T::get(self.take(T::SIZE, what)?))
    }

    /// Reads `count` values written by [`put_plain`].
    pub(super) fn plain<T: Scalar>(&mut self, count: usize, what: &str) -> Result<Vec<T>, EpisodeFault> {
        let size = count.checked_mul(T::SIZE).ok_or_else(|| malformed(format!("too many {what}")))?;
        Ok(self.take(size, what)?.chunks_exact(T::SIZE).map(T::get).collect())
    }

    /// Reads `count` values written by [`put_list`]. The caller must have checked `count`.
    pub(super) fn list<T: Scalar>(&mut self, count: usize, what: &str) -> Result<Vec<T>, EpisodeFault> {
        match self.scalar::<u8>(what)? {
            PLAIN => self.plain(count, what),
            RUNS => {
                let mut values = Vec::with_capacity(count);
                while values.len() < count {
                    let run = self.varint(what)?;
                    if run == 0 || run > (count - values.len()) as u64 {
                        return Err(malformed(format!("a run of {run} {what} for {count} steps")));
                    }
                    let value = self.scalar(what)?;
                    values.resize(values.len() + run as usize, value);
                }
                Ok(values)
            }
            other => Err(malformed(format!("unknown coding {other} of {what}"))),
        }
    }

    fn varint(&mut self, what: &str) -> Result<u64, EpisodeFault> {
        let mut value = 0;
        for shift in (0..63).step_by(7) {
            let byte: u8 = self.scalar(what)?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(malformed(format!("a run of {what} without end")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_take_the_shorter_coding_and_read_back() {
        let mut out = Vec::new();
        put_list(&[0.0f32; 1000], &mut out);
        assert_eq!(out, [RUNS, 0xe8, 0x07, 0, 0, 0, 0]);
        assert_eq!(Cursor(&out).list::<f32>(1000, "rewards"), Ok(vec![0.0; 1000]));
        out.clear();
        put_list(&[1u8, 2, 3], &mut out);
        assert_eq!(out, [PLAIN, 1, 2, 3]);
        assert_eq!(Cursor(&out).list::<u8>(3, "actions"), Ok(vec![1, 2, 3]));
    }

    #[test]
    fn the_sign_of_zero_survives_a_run() {
        let mut out = Vec::new();
        put_list(&[0.0f32, -0.0, -0.0, -0.0, -0.0, -0.0], &mut out);
        let back = Cursor(&out).list::<f32>(6, "rewards").expect("sound");
        assert!(back[0].is_sign_positive() && back[1..].iter().all(|v| v.is_sign_negative()));
    }

    #[test]
    fn runs_cannot_exceed_the_steps() {
        let endless = [RUNS, 0xff, 0xff, 0xff, 0xff, 0x7f, 1];
        assert!(Cursor(&endless).list::<u8>(3, "actions").is_err());
        assert!(Cursor(&[RUNS, 0, 1]).list::<u8>(3, "actions").is_err());
        assert!(Cursor(&[RUNS, 2, 1]).list::<u8>(3, "actions").is_err());
        assert!(Cursor(&[RUNS; 40]).list::<u8>(3, "actions").is_ok());
        assert!(Cursor(&[0x80; 40][..]).varint("actions").is_err());
        assert!(Cursor(&[]).plain::<u64>(usize::MAX, "hashes").is_err());
    }
}
