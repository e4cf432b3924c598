//! Tensors that a case generates by rule instead of storing them.

use serde_json::Value;

/// Returns a tensor that is made by rule instead of stored (SplitMix64 over the element numbers).
pub fn generate(rule: &Value) -> (String, (Vec<usize>, Vec<f64>)) {
    let shape: Vec<usize> =
        rule["shape"].as_array().into_iter().flatten().map(|n| n.as_u64().expect("size") as usize).collect();
    let seed = rule["seed"].as_u64().expect("seed");
    let bound = rule["bound"].as_f64();
    let element = |i: usize| {
        let mut z = seed.wrapping_add((i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        match bound {
            Some(bound) => f64::from((((z >> 40) as f64 / 8_388_608.0 - 1.0) * bound) as f32),
            // Bytes have no bound.
            None => (z >> 56) as f64,
        }
    };
    let values: Vec<f64> = (0..shape.iter().product()).map(element).collect();
    for (bits, x) in rule["first_bits"].as_array().into_iter().flatten().zip(&values) {
        assert_eq!(bits.as_u64(), Some(u64::from((*x as f32).to_bits())));
    }
    for (first, x) in rule["first"].as_array().into_iter().flatten().zip(&values) {
        assert_eq!(first.as_f64(), Some(*x));
    }
    (rule["name"].as_str().expect("name").to_owned(), (shape, values))
}
