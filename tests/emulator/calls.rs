//! Who calls whom in an image, from its machine code.

use std::collections::{BTreeMap, BTreeSet};

use object::{Architecture, Object, ObjectSection, ObjectSymbol, SectionKind, SymbolKind};

/// Functions by name, with the names of those they branch to.
pub struct Calls {
    callees: BTreeMap<String, BTreeSet<String>>,
}

impl Calls {
    /// Reads the Thumb code of an image with symbols. Calls through pointers are not seen.
    pub fn of(image: &object::File<'_>) -> Self {
        assert_eq!(image.architecture(), Architecture::Arm);
        let mut functions: Vec<(u32, u32, String)> = image
            .symbols()
            .filter(|s| s.kind() == SymbolKind::Text && s.size() > 0)
            .map(|s| {
                // Bit 0 of an address says that the code is Thumb.
                let start = s.address() as u32 & !1;
                let name = s.name().expect("a name").to_owned();
                (start, start + s.size() as u32, name)
            })
            .collect();
        functions.sort();
        let at = |address: u32| {
            let after = functions.partition_point(|f| f.0 <= address);
            let found = functions[..after].iter().rev().take(8);
            found.into_iter().find(|f| address < f.1).map(|f| &f.2)
        };
        let mut callees: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for section in image.sections().filter(|s| s.kind() == SectionKind::Text) {
            let code = section.data().expect("its bytes");
            for (address, target) in branches(section.address() as u32, code) {
                if let (Some(from), Some(to)) = (at(address), at(target))
                    && from != to
                {
                    callees.entry(from.clone()).or_default().insert(to.clone());
                }
            }
        }
        Self { callees }
    }

    /// Everything that may run when this function is called, itself included.
    pub fn reachable(&self, from: &str) -> BTreeSet<String> {
        let mut seen = BTreeSet::from([from.to_owned()]);
        let mut open = vec![from.to_owned()];
        while let Some(name) = open.pop() {
            for callee in self.callees.get(&name).into_iter().flatten() {
                if seen.insert(callee.clone()) {
                    open.push(callee.clone());
                }
            }
        }
        seen
    }
}

/// Places and targets of BL and B.W (ARM DDI 0403E, A7.7.12 and A7.7.18, encodings T1 and T4), and of short branches,
/// with which a function may end in a call.
fn branches(start: u32, code: &[u8]) -> Vec<(u32, u32)> {
    let half = |at: usize| Some(u16::from_le_bytes(code.get(at..at + 2)?.try_into().ok()?));
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(first) = half(at) {
        let address = start + at as u32;
        let wide = first >> 11 >= 0b11101;
        if wide {
            if let Some(second) = half(at + 2)
                && first >> 11 == 0b11110
                && second & 0x9000 == 0x9000
            {
                let sign = u32::from(first >> 10 & 1);
                let j = |bit: u16| !(u32::from(second >> bit & 1) ^ sign) & 1;
                let high = u32::from(first & 0x3FF);
                let low = u32::from(second & 0x7FF);
                let bits = sign << 24 | j(13) << 23 | j(11) << 22 | high << 12 | low << 1;
                // Sign extension from 25 bits.
                let offset = ((bits << 7) as i32) >> 7;
                found.push((address, address.wrapping_add(4).wrapping_add_signed(offset)));
            }
        } else if first >> 11 == 0b11100 {
            let offset = (i32::from(first) << 21) >> 20;
            found.push((address, address.wrapping_add(4).wrapping_add_signed(offset)));
        }
        at += if wide { 4 } else { 2 };
    }
    found
}
