//! Tables in Markdown.

use std::fmt::Write as _;

/// A table: headings, and rows of as many cells.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<String>>,
}

#[derive(Debug, Clone, PartialEq)]
struct Column {
    heading: String,
    numbers: bool,
}

impl Table {
    /// A table without rows. A heading that starts with `>` is of a column of numbers, which end at its right side.
    pub fn new(headings: &[&str]) -> Self {
        let column = |heading: &&str| match heading.strip_prefix('>') {
            Some(heading) => Column { heading: heading.into(), numbers: true },
            None => Column { heading: (*heading).into(), numbers: false },
        };
        Self { columns: headings.iter().map(column).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If it has another number of cells than the table has columns.
    pub fn push(&mut self, cells: Vec<String>) {
        assert_eq!(cells.len(), self.columns.len(), "one cell a column");
        self.rows.push(cells);
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // A bar would end the cell, a line break the table.
        let clean = |text: &str| text.replace('|', "\\|").replace('\n', " ");
        let line = |cells: &mut dyn Iterator<Item = String>| {
            let mut text = String::from("|");
            for cell in cells {
                let _ = write!(text, " {} |", clean(&cell));
            }
            text
        };
        writeln!(f, "{}", line(&mut self.columns.iter().map(|column| column.heading.clone())))?;
        let rules = self.columns.iter().map(|column| if column.numbers { "--:|" } else { "---|" });
        writeln!(f, "|{}", rules.collect::<String>())?;
        for row in &self.rows {
            writeln!(f, "{}", line(&mut row.iter().cloned()))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_markdown_whatever_is_in_their_cells() {
        let mut table = Table::new(&["choice", ">speed"]);
        assert!(table.is_empty());
        table.push(vec!["a|b\nc".into(), "1".into()]);
        assert_eq!(table.to_string(), "| choice | speed |\n|---|--:|\n| a\\|b c | 1 |\n");
    }
}
