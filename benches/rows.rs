//! What does one gather sweep cost on rows of 8 and of 16 lanes, beside all 64 bands and beside RGB (rows of 4)?
//!
//! The operator of the solve (pull, gather over the links, push) on one thread, on about 2 k, 50 k and 500 k leaves, twice:
//! the convex room refined to so many, with the links that it then has; and complete trees with 30 links at each leaf, as
//! scattered as links can be. There leaves with a common parent look at the same parts of the room, in part at the same
//! patches. All widths run the same code on the same links. Passes of all widths alternate, and the fastest of each counts,
//! so that ratios hold on a machine that is busy.
//!
//! `cargo bench --bench rows [-- test]`

use haarlight::geometry::sampling::hash;
use haarlight::hierarchy::{NONE, Node, Tree};
use haarlight::light::Rows;
use haarlight::link::{Demand, Graph, Link, LinkRows, Occlusion, Sight};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Operator, Settings};
use haarlight::team::NEVER;
use std::path::Path;
use std::time::{Duration, Instant};

/// Links of a leaf; each stands in two rows.
const LINKS: usize = 15;
/// Leaves of one part of the room that siblings look at.
const REGION: u64 = 64;
/// Time spent on each size.
const BUDGET: Duration = Duration::from_secs(12);
/// Children of the root, and how often they are quartered.
const SIZES: [(usize, u32); 3] = [(8, 4), (3, 7), (30, 7)];

/// A root with children that are quartered several times.
fn tree(top: usize, depth: u32) -> Tree {
    let leaf_area = 1.0;
    let area = |below: u32| leaf_area * 4.0_f64.powi(below as i32);
    let mut tree = Tree {
        nodes: vec![Node::bare(NONE, top as f64 * area(depth))],
        ..Tree::default()
    };
    let mut row = vec![0_u32];
    for level in 0..=depth {
        let children = if level == 0 { top } else { 4 };
        let mut next = Vec::with_capacity(row.len() * children);
        for &parent in &row {
            let first = tree.nodes.len() as u32;
            (
                tree.nodes[parent as usize].child,
                tree.nodes[parent as usize].children,
            ) = (first, children as u8);
            for _ in 0..children {
                next.push(tree.nodes.len() as u32);
                tree.nodes.push(Node::bare(parent, area(depth - level)));
            }
        }
        row = next;
    }
    tree
}

fn links(leaves: &[u32]) -> Vec<Link> {
    let n = leaves.len() as u64;
    let mut links = Vec::with_capacity(leaves.len() * LINKS);
    for k in 0..n {
        for j in 0..LINKS as u64 {
            // Half of the regions are the same for four siblings, half for sixteen cousins.
            let family = if j % 2 == 0 { k >> 2 } else { k >> 4 };
            let region = hash(family, j) % (n / REGION) * REGION;
            let other = region + hash(k, j ^ 0x55) % REGION;
            if other != k {
                links.push(Link {
                    a: leaves[k as usize],
                    b: leaves[other as usize],
                    exchange: 1.0 / 32.0,
                    open_exchange: 1.0 / 32.0,
                    variation: 0.0,
                    occlusion: Occlusion::Clear,
                });
            }
        }
    }
    links
}

/// Rows of one width and the fastest pass so far.
struct Table<const L: usize> {
    from: Rows,
    nodes: Rows,
    gathered: Rows,
    out: Rows,
    best: f64,
}

impl<const L: usize> Table<L> {
    fn new(nodes: usize, leaves: usize) -> Self {
        let mut from = Rows::zero(leaves, L);
        for k in 0..leaves {
            from.row_mut(k).fill(1.0 + (k % 7) as f32);
        }
        Self {
            from,
            nodes: Rows::zero(nodes, L),
            gathered: Rows::zero(nodes, L),
            out: Rows::zero(leaves, L),
            best: f64::INFINITY,
        }
    }

    fn pass(&mut self, operator: &Operator) {
        let start = Instant::now();
        operator.irradiance::<L>(
            &self.from,
            &mut self.nodes,
            &mut self.gathered,
            &mut self.out,
        );
        self.best = self.best.min(start.elapsed().as_secs_f64());
        std::hint::black_box(self.out.row(0));
    }
}

/// Leaves and links of a convex room, refined until it has so many leaves.
fn room(leaves: usize) -> (Tree, Vec<Link>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/convex.glb");
    let scene = Scene::load(&path, &Options::default()).expect("a room of our own");
    let bake = Bake::new(scene, Settings::default());
    let sight = Sight {
        rays: bake.rays(),
        mesh: bake.mesh(),
        opaque: None,
        panes: None,
        mirrors: None,
        occlusion: false,
    };
    let mut tree = Tree::new(bake.mesh(), &vec![0; bake.mesh().faces.len()]);
    let mut graph = Graph::default();
    // As if all were white and evenly lit.
    let even = vec![1.0_f32; 4 * leaves];
    let mut threshold = 1e-2;
    while tree.leaves().count() < leaves {
        let demand = Demand {
            bright: &even,
            sensitivity: &even,
            threshold,
            least_area: 0.0,
            hidden: true,
        };
        graph
            .refine(&mut tree, &sight, 0, &demand, &NEVER)
            .expect("nobody interrupts it");
        threshold *= 0.7;
    }
    (tree, graph.links)
}

/// Times all widths on some links and prints a line.
fn measure(what: &str, tree: &Tree, links: &[Link], short: bool) {
    let leaves: Vec<u32> = tree.leaves().collect();
    let rows = LinkRows::new(tree.nodes.len(), links);
    let areas: Vec<f64> = tree.nodes.iter().map(|n| n.area).collect();
    let factor = vec![1.0; tree.nodes.len()];
    let operator = Operator::new(tree, &rows, &leaves, &areas, &factor);
    let n = tree.nodes.len();
    let mut rgb = Table::<4>::new(n, leaves.len());
    let mut eight = Table::<8>::new(n, leaves.len());
    let mut sixteen = Table::<16>::new(n, leaves.len());
    let mut half = Table::<32>::new(n, leaves.len());
    let mut dense = Table::<64>::new(n, leaves.len());
    let start = Instant::now();
    loop {
        rgb.pass(&operator);
        eight.pass(&operator);
        sixteen.pass(&operator);
        half.pass(&operator);
        dense.pass(&operator);
        if short || start.elapsed() > BUDGET {
            break;
        }
    }
    let ns = |s: f64| 1e9 * s / rows.len() as f64;
    println!(
        "{what:<9} {:>6} {:>9} {:>6.2} {:>6.2} {:>6.2} {:>6.2} {:>6.2} | {:>5.2} {:>5.2} {:>6.2} {:>6.2}",
        leaves.len(),
        rows.len(),
        ns(rgb.best),
        ns(eight.best),
        ns(sixteen.best),
        ns(half.best),
        ns(dense.best),
        dense.best / sixteen.best,
        dense.best / eight.best,
        eight.best / rgb.best,
        sixteen.best / rgb.best
    );
}

fn main() {
    // `cargo test --benches` asks for one short look.
    let short = std::env::args().any(|a| a == "--test" || a == "test");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let Ok(pool) = pool else { return };
    println!(
        "one gather sweep, one thread, ns a link and direction; ratios to 64 leaves and to RGB"
    );
    println!(
        "links     leaves   entries    RGB      8     16     32     64 | 64:16  64:8  8:RGB 16:RGB"
    );
    for (top, depth) in SIZES {
        let scattered = tree(top, depth);
        let leaves: Vec<u32> = scattered.leaves().collect();
        let wild = links(&leaves);
        pool.install(|| measure("scattered", &scattered, &wild, short));
        if short && leaves.len() > 100_000 {
            continue;
        }
        let (refined, own) = room(leaves.len());
        pool.install(|| measure("a room's", &refined, &own, short));
    }
}
