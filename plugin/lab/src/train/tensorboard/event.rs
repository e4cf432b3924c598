//! The `Event` message of TensorFlow's `event.proto`, as far as scalars need it.

/// An event at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Seconds since 1970.
    pub wall_time: f64,
    /// Environment steps done.
    pub step: u64,
    /// Kind of the event.
    pub kind: EventKind,
}

/// Kinds of events.
#[derive(Clone, Debug, PartialEq)]
pub enum EventKind {
    /// The first event of every file: the version of the format.
    FileVersion,
    /// Values follow from this step on; later ones from another file become void.
    SessionStart,
    /// Numbers by their tags. They are kept as `f32`; NaN is allowed, and TensorBoard shows it as such.
    Scalars(Vec<(String, f64)>),
}

/// Wire types of protobuf.
const VARINT: u64 = 0;
const EIGHT_BYTES: u64 = 1;
const LENGTH_DELIMITED: u64 = 2;
const FOUR_BYTES: u64 = 5;

impl Event {
    /// Encodes the event in protobuf's wire format: fields in the order of their numbers, those that are 0 left out.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::new();
        key(1, EIGHT_BYTES, &mut out);
        out.extend(self.wall_time.to_le_bytes());
        if self.step > 0 {
            key(2, VARINT, &mut out);
            varint(self.step, &mut out);
        }
        match &self.kind {
            EventKind::FileVersion => bytes(3, b"brain.Event:2", &mut out),
            EventKind::Scalars(values) => bytes(5, &summary(values), &mut out),
            // SessionLog { status: START }.
            EventKind::SessionStart => bytes(7, &[8, 1], &mut out),
        }
        out
    }
}

/// Encodes the `Summary` message: a value for each tag.
fn summary(values: &[(String, f64)]) -> Vec<u8> {
    let mut out = Vec::new();
    for (tag, value) in values {
        let mut entry = Vec::new();
        bytes(1, tag.as_bytes(), &mut entry);
        key(2, FOUR_BYTES, &mut entry);
        entry.extend((*value as f32).to_le_bytes());
        bytes(1, &entry, &mut out);
    }
    out
}

fn key(field: u64, wire_type: u64, out: &mut Vec<u8>) {
    varint(field << 3 | wire_type, out);
}

fn bytes(field: u64, content: &[u8], out: &mut Vec<u8>) {
    key(field, LENGTH_DELIMITED, out);
    varint(content.len() as u64, out);
    out.extend(content);
}

/// Encodes seven bits a byte, the lowest first; the highest bit of a byte marks a following byte.
fn varint(mut value: u64, out: &mut Vec<u8>) {
    while value > 0x7f {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hex(event: &Event) -> String {
        event.encode().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// The expected bytes are what the `Event` class of TensorBoard 2.21 serialises.
    #[test]
    fn events_are_those_of_tensorboard() {
        let mut event = Event { wall_time: 1.5, step: 0, kind: EventKind::FileVersion };
        assert_eq!(hex(&event), "09000000000000f83f1a0d627261696e2e4576656e743a32");
        event.kind = EventKind::SessionStart;
        assert_eq!(hex(&event), "09000000000000f83f3a020801");
        let values = vec![("a/b".to_owned(), 0.5), ("c".to_owned(), f64::NAN)];
        let event = Event { wall_time: 2.25, step: 300, kind: EventKind::Scalars(values) };
        assert_eq!(hex(&event), "09000000000000024010ac022a160a0a0a03612f62150000003f0a080a0163150000c07f");
    }

    #[test]
    fn the_largest_number_takes_ten_bytes() {
        let mut out = Vec::new();
        varint(u64::MAX, &mut out);
        assert_eq!(out, [[0xff; 9].as_slice(), &[1]].concat());
    }
}
