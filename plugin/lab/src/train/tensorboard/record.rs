//! TFRecord framing: length, checksum of the length, data, checksum of the data; numbers are little-endian.

/// Offset added to a rotated checksum, which makes checksums of data that contains checksums reliable.
const MASK: u32 = 0xa282_ead8;

/// Appends one record with this content.
pub(super) fn frame(data: &[u8], out: &mut Vec<u8>) {
    let length = (data.len() as u64).to_le_bytes();
    out.extend(length);
    out.extend(masked_crc(&length).to_le_bytes());
    out.extend(data);
    out.extend(masked_crc(data).to_le_bytes());
}

/// Returns the CRC-32C (Castagnoli), rotated right by 15 bits and masked.
fn masked_crc(data: &[u8]) -> u32 {
    crc32c::crc32c(data).rotate_right(15).wrapping_add(MASK)
}

#[cfg(test)]
mod tests {
    use super::{super::testing::whole_records, *};

    #[test]
    fn checksums_are_those_of_the_standard() {
        // RFC 3720, appendix B.4, and the check value of CRC-32C.
        assert_eq!(crc32c::crc32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(crc32c::crc32c(b"123456789"), 0xe306_9283);
        // TensorBoard 2.21's `masked_crc32c`.
        assert_eq!(masked_crc(b"123456789"), 0xc78a_b0e5);
    }

    #[test]
    fn records_are_those_of_tensorboards_writer() {
        let data = [&[9, 0, 0, 0, 0, 0, 0, 0xf8, 0x3f, 0x1a, 0x0d][..], b"brain.Event:2"].concat();
        let mut framed = Vec::new();
        frame(&data, &mut framed);
        let expected = [&[0x18, 0, 0, 0, 0, 0, 0, 0, 0xa3, 0x7f, 0x4b, 0x22], &data[..], &[0x2a, 0x28, 0x64, 0x6c]];
        assert_eq!(framed, expected.concat());
        assert_eq!(whole_records(&framed), (vec![&data[..]], framed.len()));
        assert_eq!(whole_records(&framed[..framed.len() - 1]), (vec![], 0));
    }
}
