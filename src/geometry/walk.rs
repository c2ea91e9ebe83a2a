//! What every walk through the tree needs: one line against the eight boxes of a node, and a stack.

use super::bvh::{BvhNode, WIDTH};
use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use glam::Vec3;

/// Entries of a traversal's stack before it moves to the heap; a tree of a million triangles seldom needs as many.
const STACK: usize = 64;

/// A line prepared for boxes.
pub(crate) struct Slabs<S: Simd> {
    /// 1/d, and start/d.
    inverse: [f32x8<S>; 3],
    offset: [f32x8<S>; 3],
    /// 1 where the line runs down its axis, so that its high side comes first.
    down: [usize; 3],
}

/// Direction components nearer to zero than this are taken as this: a finite slab distance, far beyond any scene.
pub(crate) const LEAST_COMPONENT: f32 = 1e-30;

/// 1/d, finite.
#[inline(always)]
fn safe_inverse(d: f32) -> f32 {
    1.0 / if d.abs() < LEAST_COMPONENT {
        LEAST_COMPONENT.copysign(d)
    } else {
        d
    }
}

impl<S: Simd> Slabs<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, from: Vec3, direction: Vec3) -> Self {
        let inverse = [
            safe_inverse(direction.x),
            safe_inverse(direction.y),
            safe_inverse(direction.z),
        ];
        let mut slabs = Self {
            inverse: [f32x8::splat(simd, 0.0); 3],
            offset: [f32x8::splat(simd, 0.0); 3],
            down: [0; 3],
        };
        for (axis, &x) in inverse.iter().enumerate() {
            slabs.inverse[axis] = f32x8::splat(simd, x);
            slabs.offset[axis] = f32x8::splat(simd, from[axis] * x);
            slabs.down[axis] = usize::from(x < 0.0);
        }
        slabs
    }

    /// Where the line enters the eight boxes, and a bit for each that it meets before `t_max`.
    #[inline(always)]
    pub(crate) fn enter(&self, node: &BvhNode, t_max: f32) -> (f32x8<S>, u32) {
        let simd = self.inverse[0].simd;
        let mut near = f32x8::splat(simd, 0.0);
        let mut far = f32x8::splat(simd, t_max);
        for axis in 0..3 {
            let down = self.down[axis];
            let side = |k: usize| node.bounds[k][axis].load(simd);
            let first = side(down).mul_sub(self.inverse[axis], self.offset[axis]);
            let last = side(1 - down).mul_sub(self.inverse[axis], self.offset[axis]);
            near = near.max(first);
            far = far.min(last);
        }
        let met = near.simd_le(far).to_bitmask() as u32;
        (near, met & ((1 << node.count) - 1))
    }
}

/// A stack on the stack, and on the heap when it is full.
pub(crate) struct Stack<T: Copy> {
    place: [T; STACK],
    used: usize,
    spill: Vec<T>,
}

impl<T: Copy> Stack<T> {
    #[inline(always)]
    pub(crate) fn new(first: T) -> Self {
        Self {
            place: [first; STACK],
            used: 1,
            spill: Vec::new(),
        }
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, item: T) {
        if let Some(place) = self.place.get_mut(self.used) {
            *place = item;
            self.used += 1;
        } else {
            self.spill.push(item);
        }
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        if let Some(item) = self.spill.pop() {
            return Some(item);
        }
        self.used = self.used.checked_sub(1)?;
        self.place.get(self.used).copied()
    }
}

/// Pushes the children that the line meets, the farthest first.
#[inline(always)]
pub(crate) fn push_by_distance<S: Simd>(
    node: &BvhNode,
    slabs: &Slabs<S>,
    t_max: f32,
    stack: &mut Stack<(f32, u32)>,
) {
    let (near, mut met) = slabs.enter(node, t_max);
    let near = near.to_array();
    let mut sorted = [(0.0f32, 0u32); WIDTH];
    let mut count = 0;
    while met != 0 {
        let lane = met.trailing_zeros() as usize;
        met &= met - 1;
        let mut place = count;
        while place > 0 && sorted[place - 1].0 < near[lane] {
            sorted[place] = sorted[place - 1];
            place -= 1;
        }
        sorted[place] = (near[lane], node.children[lane]);
        count += 1;
    }
    for &entry in &sorted[..count] {
        stack.push(entry);
    }
}
