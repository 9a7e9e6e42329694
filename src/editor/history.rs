//! What was done, so that it can be undone.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use crate::editor::item::Item;
use crate::error::Result;

/// Texts before older changes than these take no more memory than this, in bytes.
const MOST_BYTES: usize = 64 << 20;

/// A scene at a moment.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Its text.
    pub text: Arc<str>,
    /// What was selected.
    pub selection: BTreeSet<Item>,
}

#[derive(Debug)]
struct Step {
    /// What is to be restored.
    state: State,
    label: String,
}

/// States to go back to, and to go forward to again.
#[derive(Debug, Default)]
pub struct History {
    undo: VecDeque<Step>,
    redo: Vec<Step>,
    bytes: usize,
    /// The movement that the last step belongs to, as long as it goes on.
    movement: Option<u64>,
}

impl History {
    /// Remembers the state before a change.
    pub fn push(&mut self, before: State, label: String, movement: Option<u64>) {
        self.redo.clear();
        self.bytes += before.text.len();
        self.undo.push_back(Step { state: before, label });
        while self.bytes > MOST_BYTES && self.undo.len() > 1 {
            self.bytes -= self.undo.pop_front().map_or(0, |step| step.state.text.len());
        }
        self.movement = movement;
    }

    /// The last change is made otherwise.
    pub fn go_on(&mut self) {
        self.redo.clear();
    }

    /// The movement that goes on.
    pub fn movement(&self) -> Option<u64> {
        self.movement
    }

    /// The next change is a step of its own.
    pub fn end_movement(&mut self) {
        self.movement = None;
    }

    /// The state before the last change, which undo restores.
    pub fn before(&self) -> Option<&State> {
        self.undo.back().map(|step| &step.state)
    }

    /// The state that redo restores.
    pub fn peek_redo(&self) -> Option<&State> {
        self.redo.last().map(|step| &step.state)
    }

    /// The state before the last change is restored; `now` is what redo restores.
    pub fn undo(&mut self, now: State) {
        self.movement = None;
        if let Some(Step { state, label }) = self.undo.pop_back() {
            self.bytes -= state.text.len();
            self.redo.push(Step { state: now, label });
        }
    }

    /// The state after the last change that was undone is restored; `now` is what undo restores.
    pub fn redo(&mut self, now: State) {
        self.movement = None;
        if let Some(Step { label, .. }) = self.redo.pop() {
            self.bytes += now.text.len();
            self.undo.push_back(Step { state: now, label });
        }
    }

    /// What undo takes back.
    pub fn undo_label(&self) -> Option<&str> {
        self.undo.back().map(|step| step.label.as_str())
    }

    /// What redo does again.
    pub fn redo_label(&self) -> Option<&str> {
        self.redo.last().map(|step| step.label.as_str())
    }

    /// Changes every text.
    ///
    /// # Errors
    /// The first of `change`'s; some texts are changed then.
    pub fn each(&mut self, change: impl Fn(&str) -> Result<Arc<str>>) -> Result<()> {
        for step in self.undo.iter_mut().chain(&mut self.redo) {
            step.state.text = change(&step.state.text)?;
        }
        self.bytes = self.undo.iter().map(|step| step.state.text.len()).sum();
        Ok(())
    }
}
