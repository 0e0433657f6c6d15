//! Things with the number of their sector around a sensor -> the same, sector by sector.
//!
//! In each sector they keep their order (a counting sort), so that what is summed over a sector does not depend on how many others there are.

use std::ops::Range;

/// Things in their sectors: those of sector k are `sorted[span(first, k)]`. Both are reused memory.
pub(super) fn sort_by_sector<T: Copy + Default>(
    numbered: &[(u32, T)],
    sectors: usize,
    first: &mut Vec<u32>,
    sorted: &mut Vec<T>,
) {
    first.clear();
    first.resize(sectors + 1, 0);
    numbered.iter().for_each(|&(sector, _)| first[sector as usize + 1] += 1);
    (0..sectors).for_each(|sector| first[sector + 1] += first[sector]);
    let mut next = first.clone();
    sorted.clear();
    sorted.resize(numbered.len(), T::default());
    for &(sector, thing) in numbered {
        let place = &mut next[sector as usize];
        sorted[*place as usize] = thing;
        *place += 1;
    }
}

/// The places of sector `k`.
pub(super) fn span(first: &[u32], k: usize) -> Range<usize> {
    first[k] as usize..first[k + 1] as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_things_stand_sector_by_sector_in_their_order() {
        let (mut first, mut sorted) = (vec![9], vec!['z']);
        sort_by_sector(&[(2, 'a'), (0, 'b'), (2, 'c'), (0, 'd')], 4, &mut first, &mut sorted);
        assert_eq!((first.as_slice(), sorted.as_slice()), (&[0, 2, 2, 4, 4][..], &['b', 'd', 'a', 'c'][..]));
        assert_eq!([0, 1, 2, 3].map(|k| span(&first, k)), [0..2, 2..2, 2..4, 4..4]);
        sort_by_sector(&[], 1, &mut first, &mut sorted);
        assert_eq!((first.as_slice(), sorted.len()), (&[0, 0][..], 0));
    }
}
