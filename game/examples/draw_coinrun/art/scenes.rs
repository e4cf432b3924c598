//! The backdrops: 12 of landscapes and 4 of space, in muted colours, against which a level stands out.

use super::backdrop::{Layer::*, Scene};

/// Returns all scenes in the order in which the game numbers them.
#[rustfmt::skip]
pub fn all() -> Vec<Scene> {
    vec![
        Scene { name: "meadow", sky: [0x9dbfd2, 0xd3e3e0], layers: vec![
            Clouds { low: 70, high: 240, number: 16, size: 10, colour: 0xe6eef0 },
            Hills { height: 34, swing: 46, length: 120, colour: 0xa9c4b0 },
            Hills { height: 16, swing: 36, length: 90, colour: 0x93b397 },
            Trees { height: 14, size: 18, gap: 60, stem: 0x7f8b74, crown: 0x82a385 },
        ] },
        Scene { name: "dusk", sky: [0x6f6288, 0xd0a69c], layers: vec![
            Disc { x: 150, height: 96, radius: 22, colour: 0xdfbfa4, shade: 0xd8b29f },
            Peaks { height: 30, swing: 70, length: 100, colour: 0x8b7391, cap: 0xa58a9f },
            Hills { height: 14, swing: 30, length: 80, colour: 0x70607f },
        ] },
        Scene { name: "desert", sky: [0xc4b698, 0xe2d3b4], layers: vec![
            Disc { x: 250, height: 130, radius: 18, colour: 0xeee3c4, shade: 0xe8dabb },
            Peaks { height: 24, swing: 56, length: 140, colour: 0xc2a487, cap: 0xc2a487 },
            Hills { height: 18, swing: 24, length: 110, colour: 0xcbb08d },
            Hills { height: 4, swing: 20, length: 80, colour: 0xbc9f7d },
        ] },
        Scene { name: "forest", sky: [0x7f9a94, 0xa9bfae], layers: vec![
            Pillars { width: 8, gap: 36, colour: 0x8ea696, light: 0x99b0a0 },
            Pillars { width: 13, gap: 58, colour: 0x748d7d, light: 0x7f9888 },
            Blots { low: 0, high: 22, number: 70, size: 14, colour: 0x66806d },
            Blots { low: 190, high: 256, number: 90, size: 22, colour: 0x66806d },
        ] },
        Scene { name: "winter", sky: [0xa4b2c4, 0xc8d1da], layers: vec![
            Peaks { height: 36, swing: 84, length: 130, colour: 0x94a5b8, cap: 0xd5dce3 },
            Firs { height: 16, size: 40, gap: 30, stem: 0x7b858e, crown: 0x7f99a3 },
            Hills { height: 8, swing: 18, length: 90, colour: 0xb4c1cd },
        ] },
        Scene { name: "cave", sky: [0x3c3438, 0x54494c], layers: vec![
            Stalactites { length: 90, width: 34, colour: 0x4a4044 },
            Blots { low: 0, high: 256, number: 60, size: 10, colour: 0x5d5155 },
            Stalactites { length: 60, width: 22, colour: 0x383034 },
        ] },
        Scene { name: "city", sky: [0x8794a8, 0xb6b6b8], layers: vec![
            Towers { height: 60, swing: 70, width: 34, colour: 0x97a0ae, window: 0xa5adb8 },
            Towers { height: 24, swing: 50, width: 26, colour: 0x79828f, window: 0xb9b199 },
        ] },
        Scene { name: "bricks", sky: [0x7c6361, 0x8d706b], layers: vec![
            Bricks { width: 24, height: 12, joint: 0x6f5857 },
            Pillars { width: 16, gap: 96, colour: 0x98807a, light: 0xa88f88 },
        ] },
        Scene { name: "sea", sky: [0x92b2bd, 0xb8cfcd], layers: vec![
            Clouds { low: 100, high: 240, number: 12, size: 12, colour: 0xcfdedd },
            Hills { height: 56, swing: 4, length: 200, colour: 0x6f9ca3 },
            Waves { height: 54, gap: 9, colour: 0x84adb1 },
            Peaks { height: 40, swing: 40, length: 260, colour: 0x8fa398, cap: 0x9eb0a3 },
            Hills { height: 22, swing: 4, length: 160, colour: 0x5f8d97 },
            Waves { height: 20, gap: 8, colour: 0x76a1a8 },
        ] },
        Scene { name: "night", sky: [0x232a44, 0x3b4360], layers: vec![
            Stars { number: 260, colour: 0x6f7898 },
            Disc { x: 110, height: 84, radius: 20, colour: 0xa8adb4, shade: 0x8c92a0 },
            Hills { height: 26, swing: 40, length: 110, colour: 0x2f3853 },
            Firs { height: 12, size: 34, gap: 38, stem: 0x242b40, crown: 0x283149 },
        ] },
        Scene { name: "swamp", sky: [0x73795f, 0x97987a], layers: vec![
            Trees { height: 20, size: 60, gap: 90, stem: 0x676b54, crown: 0x6f765a },
            Hills { height: 14, swing: 16, length: 70, colour: 0x7d8266 },
            Blots { low: 0, high: 16, number: 50, size: 12, colour: 0x5d6350 },
        ] },
        Scene { name: "autumn", sky: [0xb9aaa8, 0xd6c6b0], layers: vec![
            Hills { height: 30, swing: 40, length: 130, colour: 0xbf9f86 },
            Trees { height: 20, size: 34, gap: 44, stem: 0x8a7468, crown: 0xb38a6c },
            Hills { height: 6, swing: 18, length: 70, colour: 0xa38a6e },
            Trees { height: 8, size: 22, gap: 70, stem: 0x7d695e, crown: 0xa8805f },
        ] },
        Scene { name: "stars", sky: [0x14172b, 0x23284a], layers: vec![
            Stars { number: 420, colour: 0x7a82a8 },
            Disc { x: 210, height: 70, radius: 34, colour: 0x4a5a86, shade: 0x384569 },
        ] },
        Scene { name: "nebula", sky: [0x33203f, 0x4c2f58], layers: vec![
            Blots { low: 0, high: 256, number: 40, size: 44, colour: 0x452a52 },
            Blots { low: 0, high: 200, number: 30, size: 26, colour: 0x5c3c68 },
            Stars { number: 260, colour: 0x9581a4 },
        ] },
        Scene { name: "ringed", sky: [0x17343a, 0x28504f], layers: vec![
            Stars { number: 260, colour: 0x6f9694 },
            Disc { x: 170, height: 76, radius: 40, colour: 0x5f8a82, shade: 0x48706b },
            Ring { x: 170, height: 76, radius: 66, colour: 0x88a79d },
        ] },
        Scene { name: "red_planet", sky: [0x301a1c, 0x5c3732], layers: vec![
            Stars { number: 160, colour: 0x8c6a64 },
            Disc { x: 120, height: 120, radius: 16, colour: 0x8e6a5c, shade: 0x74524a },
            Peaks { height: 20, swing: 60, length: 90, colour: 0x6b423b, cap: 0x6b423b },
            Hills { height: 10, swing: 22, length: 100, colour: 0x573430 },
        ] },
    ]
}
