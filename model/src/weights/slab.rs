//! One piece of memory for all the weights of a network, in the order of their
//! use and in large pages where the system has them: with small ones a step
//! waits for the page table every 4 KiB.

use std::ops::{Deref, Range};
use std::sync::Arc;

use bytemuck::{NoUninit, Pod};
use memmap2::MmapMut;

/// Where a piece begins: a cache line.
const LINE: usize = 64;
/// Bytes of a large page.
const LARGE_PAGE: usize = 2 << 20;

/// Numbers by themselves, or in a slab with others.
#[derive(Clone, Debug)]
pub(crate) enum Held<T> {
    Own(Vec<T>),
    In(Arc<MmapMut>, Range<usize>),
}

impl<T: Pod> Deref for Held<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match self {
            Self::Own(all) => all,
            Self::In(slab, range) => bytemuck::cast_slice(&slab[range.clone()]),
        }
    }
}

impl<T> Default for Held<T> {
    fn default() -> Self {
        Self::Own(Vec::new())
    }
}

impl<T: Pod> Extend<T> for Held<T> {
    fn extend<I: IntoIterator<Item = T>>(&mut self, more: I) {
        if let Self::In(..) = self {
            *self = Self::Own(self.to_vec());
        }
        if let Self::Own(all) = self {
            all.extend(more);
        }
    }
}

pub(crate) trait Piece {
    /// The bytes; afterwards there are none.
    fn take(&mut self) -> Box<dyn AsRef<[u8]>>;
    fn place(&mut self, slab: &Arc<MmapMut>, range: Range<usize>);
    fn size(&self) -> usize;
}

struct Bytes<T>(Vec<T>);

impl<T: NoUninit> AsRef<[u8]> for Bytes<T> {
    fn as_ref(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

impl<T: Pod> Piece for Held<T> {
    fn take(&mut self) -> Box<dyn AsRef<[u8]>> {
        Box::new(Bytes(match std::mem::take(self) {
            Self::Own(all) => all,
            placed => placed.to_vec(),
        }))
    }

    fn place(&mut self, slab: &Arc<MmapMut>, range: Range<usize>) {
        *self = Self::In(Arc::clone(slab), range);
    }

    fn size(&self) -> usize {
        std::mem::size_of_val(&**self)
    }
}

/// Moves pieces into one slab; leaves them where they are if they are few, or
/// the system gives no memory of that kind.
pub(crate) fn gather<'a>(pieces: impl IntoIterator<Item = &'a mut dyn Piece>) {
    let mut pieces: Vec<_> = pieces.into_iter().collect();
    let size: usize = pieces.iter().map(|p| p.size().next_multiple_of(LINE)).sum();
    if size < LARGE_PAGE {
        return;
    }
    let Ok(mut slab) = MmapMut::map_anon(size + LARGE_PAGE) else {
        return;
    };
    #[cfg(target_os = "linux")]
    // Only a wish.
    let _ = slab.advise(memmap2::Advice::HugePage);
    let mut at = slab.as_ptr().align_offset(LARGE_PAGE).min(LARGE_PAGE);
    let mut ranges = Vec::with_capacity(pieces.len());
    for piece in &mut pieces {
        let range = at..at + piece.size();
        slab[range.clone()].copy_from_slice((*piece.take()).as_ref());
        at = range.end.next_multiple_of(LINE);
        ranges.push(range);
    }
    let slab = Arc::new(slab);
    for (piece, range) in pieces.into_iter().zip(ranges) {
        piece.place(&slab, range);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gathered_numbers_are_what_they_were() {
        let floats: Vec<f32> = (0..700_001).map(|i| i as f32).collect();
        let halves: Vec<u16> = (0..333).collect();
        let mut first = Held::Own(floats.clone());
        let (mut second, mut none) = (Held::Own(halves.clone()), Held::<i8>::default());
        gather([&mut first as &mut dyn Piece, &mut none, &mut second]);
        assert!(matches!(first, Held::In(..)) && matches!(second, Held::In(..)));
        assert_eq!(first.as_ptr().align_offset(LARGE_PAGE), 0);
        assert_eq!(second.as_ptr().align_offset(LINE), 0);
        assert_eq!((&*first, &*second, none.len()), (&*floats, &*halves, 0));
        second.extend([7]);
        assert_eq!((second[332], second[333]), (332, 7));
    }

    #[test]
    fn few_stay_where_they_are() {
        let mut few = Held::Own(vec![1u8; 100]);
        gather([&mut few as &mut dyn Piece]);
        assert!(matches!(few, Held::Own(_)));
    }
}
