//! Rectangles on pages, by the skyline method (Jylänki 2010, "A thousand ways to pack the bin", section 2.3: lowest place first).

/// Sides of pages are multiples of this, as block-compressed formats want them.
const BLOCK: usize = 4;
/// Widths of a page that are tried: roots of so many times what its rectangles need. Charts of many sizes fill a square best,
/// few large ones what happens to fit them.
const WIDTHS: [f64; 6] = [1.02, 1.08, 1.2, 1.4, 1.7, 2.2];

/// Where a rectangle lies.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct AtlasPlace {
    pub(super) page: usize,
    pub(super) x: usize,
    pub(super) y: usize,
}

/// Places rectangles (width, height) on as few pages as this finds, none larger than `most` or the largest rectangle along an
/// axis; and the pages' sizes.
pub(super) fn pack(sizes: &[[usize; 2]], most: usize) -> (Vec<AtlasPlace>, Vec<[usize; 2]>) {
    // Whoever asks for more than a page gets a larger one.
    let most = sizes.iter().flatten().copied().fold(most, usize::max);
    let mut places = vec![
        AtlasPlace {
            page: 0,
            x: 0,
            y: 0
        };
        sizes.len()
    ];
    let mut open: Vec<usize> = (0..sizes.len()).collect();
    open.sort_by_key(|&k| {
        (
            std::cmp::Reverse(sizes[k][1]),
            std::cmp::Reverse(sizes[k][0]),
            k,
        )
    });
    let mut pages = Vec::new();
    while !open.is_empty() {
        let area: usize = open.iter().map(|&k| sizes[k][0] * sizes[k][1]).sum();
        let widest = open.iter().map(|&k| sizes[k][0]).max().unwrap_or(0);
        let tried = WIDTHS.map(|factor| {
            let wanted = ((factor * area as f64).sqrt() as usize).max(widest);
            let width = wanted.next_multiple_of(BLOCK).min(most);
            filled(sizes, &open, width, most)
        });
        // All that is left if that goes on a page, on the smallest; else as much as can be.
        let best = tried.into_iter().reduce(|best, next| {
            let key = |page: &Filled| (std::cmp::Reverse(page.put.len()), page.width * page.used);
            if key(&next) < key(&best) { next } else { best }
        });
        let Some(best) = best else {
            break;
        };
        for &(k, x, y) in &best.put {
            places[k] = AtlasPlace {
                page: pages.len(),
                x,
                y,
            };
        }
        let put: std::collections::HashSet<usize> = best.put.iter().map(|p| p.0).collect();
        open.retain(|k| !put.contains(k));
        pages.push([best.width, best.used.next_multiple_of(BLOCK).min(most)]);
    }
    (places, pages)
}

/// A page with rectangles on it: number and corner of each.
struct Filled {
    width: usize,
    used: usize,
    put: Vec<(usize, usize, usize)>,
}

/// Puts as many rectangles as fit on a page, in order.
fn filled(sizes: &[[usize; 2]], open: &[usize], width: usize, most: usize) -> Filled {
    let mut page = Skyline::new(width, most);
    let put = open.iter().filter_map(|&k| {
        let (x, y) = page.put(sizes[k][0], sizes[k][1])?;
        Some((k, x, y))
    });
    let put: Vec<(usize, usize, usize)> = put.collect();
    let used = put.iter().map(|&(k, _, y)| y + sizes[k][1]).max();
    Filled {
        width,
        used: used.unwrap_or(0),
        put,
    }
}

/// What of a page is full: pieces from left to right, each with its left end and height.
struct Skyline {
    width: usize,
    most: usize,
    pieces: Vec<(usize, usize)>,
}

impl Skyline {
    fn new(width: usize, most: usize) -> Self {
        Self {
            width,
            most,
            pieces: vec![(0, 0)],
        }
    }

    fn end(&self, k: usize) -> usize {
        self.pieces.get(k + 1).map_or(self.width, |p| p.0)
    }

    /// Puts a rectangle at the lowest place, the leftmost of these.
    fn put(&mut self, w: usize, h: usize) -> Option<(usize, usize)> {
        let mut best: Option<(usize, usize)> = None;
        for k in 0..self.pieces.len() {
            let x = self.pieces[k].0;
            if x + w > self.width {
                break;
            }
            let over = (k..self.pieces.len()).take_while(|&j| self.pieces[j].0 < x + w);
            let y = over.map(|j| self.pieces[j].1).max().unwrap_or(0);
            if y + h <= self.most && best.is_none_or(|(_, lowest)| y < lowest) {
                best = Some((x, y));
            }
        }
        let (x, y) = best?;
        let last = (0..self.pieces.len()).rfind(|&k| self.pieces[k].0 < x + w)?;
        let (end, height) = (self.end(last), self.pieces[last].1);
        let first = self.pieces.iter().position(|p| p.0 >= x)?;
        let mut new = vec![(x, y + h)];
        if end > x + w {
            new.push((x + w, height));
        }
        self.pieces.splice(first..=last, new);
        Some((x, y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;

    #[test]
    fn rectangles_lie_apart_on_their_pages() {
        let mut rng = Pcg::new(3);
        let mut side = || 1 + (rng.f64() * rng.f64() * 90.0) as usize;
        let sizes: Vec<[usize; 2]> = (0..400).map(|_| [side(), side()]).collect();
        let (places, pages) = pack(&sizes, 256);
        assert!(pages.len() > 1);
        let mut taken: Vec<Vec<bool>> = pages.iter().map(|[w, h]| vec![false; w * h]).collect();
        for (place, [w, h]) in places.iter().zip(&sizes) {
            let [width, height] = pages[place.page];
            assert!(place.x + w <= width && place.y + h <= height);
            for y in place.y..place.y + h {
                for x in place.x..place.x + w {
                    let taken = &mut taken[place.page][y * width + x];
                    assert!(!*taken);
                    *taken = true;
                }
            }
        }
        let area: usize = pages.iter().map(|[w, h]| w * h).sum();
        let used: usize = sizes.iter().map(|[w, h]| w * h).sum();
        assert!(used as f64 > 0.8 * area as f64, "{used} of {area}");
    }
}
