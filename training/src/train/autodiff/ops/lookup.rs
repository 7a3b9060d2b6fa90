//! Rows out of learned tables, and the stream of a batch whose sequences may
//! lack their input.

use crate::train::autodiff::lanes;
use crate::train::autodiff::parameters::ParamId;
use crate::train::autodiff::tape::{Gradients, Operation, Tape, Var};

struct Lookup {
    onto: Option<Var>,
    table: ParamId,
    rows: Vec<u32>,
}

struct OrElse {
    stream: Var,
    instead: ParamId,
    length: usize,
    has: Vec<bool>,
}

impl Tape<'_> {
    /// `table[rows]`, plus `onto` if there is one; the table has `columns`.
    pub fn lookup(
        &mut self,
        onto: Option<Var>,
        table: ParamId,
        columns: usize,
        rows: Vec<u32>,
    ) -> Var {
        let mut out = self.buffers.take(rows.len() * columns);
        match onto {
            Some(value) => out.copy_from_slice(self.data(value)),
            None => out.fill(0.0),
        }
        let entries = self.parameters.get(table);
        for (out, row) in out.chunks_mut(columns).zip(&rows) {
            lanes::add(out, &entries[*row as usize * columns..][..columns]);
        }
        self.record(out, columns, Lookup { onto, table, rows })
    }

    /// The stream where a sequence of `length` frames has one, else the learned `instead`.
    pub fn or_else(&mut self, stream: Var, instead: ParamId, length: usize, has: Vec<bool>) -> Var {
        let columns = self.columns(stream);
        let mut out = self.buffers.take(self.data(stream).len());
        out.copy_from_slice(self.data(stream));
        let null = self.parameters.get(instead);
        for (frames, _) in out.chunks_mut(length * columns).zip(&has).filter(|(_, has)| !**has) {
            frames.chunks_mut(columns).for_each(|row| row.copy_from_slice(null));
        }
        let by = OrElse { stream, instead, length, has };
        self.record(out, columns, by)
    }
}

impl Operation for Lookup {
    fn backward(&self, tape: &Tape, this: Var, gradient: Vec<f32>, into: &mut Gradients) {
        let columns = tape.columns(this);
        let table = into.parameters.of(self.table);
        for (row, g) in self.rows.iter().zip(gradient.chunks(columns)) {
            lanes::add(&mut table[*row as usize * columns..][..columns], g);
        }
        match self.onto {
            Some(onto) if tape.learns(onto) => into.add(onto, gradient),
            _ => into.buffers.give(gradient),
        }
    }
}

impl Operation for OrElse {
    fn backward(&self, tape: &Tape, this: Var, mut gradient: Vec<f32>, into: &mut Gradients) {
        let columns = tape.columns(this);
        let null = into.parameters.of(self.instead);
        let sequences = gradient.chunks_mut(self.length * columns).zip(&self.has);
        for (frames, _) in sequences.filter(|(_, has)| !**has) {
            frames.chunks(columns).for_each(|row| lanes::add(null, row));
            frames.fill(0.0);
        }
        into.add(self.stream, gradient);
    }
}
