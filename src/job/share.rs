//! Which share of the work is this process's.

use std::fmt;
use std::str::FromStr;

/// One of several equal shares: of a picture's tiles, or of a range of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub struct Share {
    /// Which, from 1 to `of`.
    pub number: u32,
    /// How many there are.
    pub of: u32,
}

impl Share {
    /// The most shares that make sense.
    pub const MOST: u32 = 1 << 20;

    /// The share of a task of a Slurm job array, whose variables `variable` looks up: the tasks in their order, from
    /// `SLURM_ARRAY_TASK_MIN` on, by steps of `SLURM_ARRAY_TASK_STEP` (1 where it is not set).
    ///
    /// # Errors
    /// Says which variable is missing or makes no sense.
    pub fn of_slurm_task(variable: impl Fn(&str) -> Option<String>) -> Result<Self, String> {
        let number = |name: &str| -> Result<u64, String> {
            let text =
                variable(name).ok_or_else(|| format!("`{name}` is not set: this is no task of a Slurm job array"))?;
            text.trim().parse().map_err(|_| format!("`{name}` is `{text}`, not a number"))
        };
        let (task, first, count) =
            (number("SLURM_ARRAY_TASK_ID")?, number("SLURM_ARRAY_TASK_MIN")?, number("SLURM_ARRAY_TASK_COUNT")?);
        let step = if variable("SLURM_ARRAY_TASK_STEP").is_some() { number("SLURM_ARRAY_TASK_STEP")? } else { 1 };
        let offset = task.checked_sub(first).filter(|offset| step > 0 && offset % step == 0);
        let share =
            offset.map(|offset| offset / step + 1).filter(|&share| share <= count && count <= Self::MOST.into());
        let share = share.ok_or_else(|| {
            format!(
                "task {task} is none of {count} from {first} on by steps of {step}: number the array `1-N` or `0-M`"
            )
        })?;
        Ok(Self { number: share as u32, of: count as u32 })
    }

    /// The numbers from `first` to `last` that are this share's: every `of`-th.
    pub fn frames(self, first: i32, last: i32) -> impl Iterator<Item = i32> {
        (first..=last).skip(self.number as usize - 1).step_by(self.of as usize)
    }
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Share {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((number, of)) if (1..=of).contains(&number) && of <= Self::MOST => Ok(Self { number, of }),
            _ => Err(format!("a share is K/N, such as 2/8: K from 1 to N, and N at most {}", Self::MOST)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_read_as_they_are_written() {
        let share = Share { number: 2, of: 8 };
        assert_eq!(share.to_string().parse(), Ok(share));
        for flawed in ["", "3", "0/8", "9/8", "1/0", "-1/2", "1/2/3", "1/99999999", "a/b"] {
            assert!(flawed.parse::<Share>().is_err(), "{flawed}");
        }
    }

    #[test]
    fn tasks_of_slurm_become_shares() {
        let task = |values: [&str; 4]| {
            let names =
                ["SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_STEP"];
            Share::of_slurm_task(|name| {
                let at = names.iter().position(|known| *known == name)?;
                (!values[at].is_empty()).then(|| values[at].to_owned())
            })
        };
        assert_eq!(task(["3", "0", "8", "1"]), Ok(Share { number: 4, of: 8 }));
        assert_eq!(task(["8", "1", "8", ""]), Ok(Share { number: 8, of: 8 }));
        assert_eq!(task(["9", "1", "5", "2"]), Ok(Share { number: 5, of: 5 }));
        for (flawed, told) in [
            (["", "0", "8", "1"], "SLURM_ARRAY_TASK_ID"),
            (["1", "0", "", "1"], "SLURM_ARRAY_TASK_COUNT"),
            (["x", "0", "8", "1"], "not a number"),
            (["8", "0", "8", "1"], "1-N"),
            (["2", "1", "8", "2"], "1-N"),
            (["1", "2", "8", "1"], "1-N"),
            (["1", "1", "8", "0"], "1-N"),
        ] {
            assert!(task(flawed).unwrap_err().contains(told), "{flawed:?}");
        }
    }

    #[test]
    fn frames_are_shared() {
        let frames = |number| Share { number, of: 3 }.frames(-1, 5).collect::<Vec<_>>();
        assert_eq!([frames(1), frames(2), frames(3)], [vec![-1, 2, 5], vec![0, 3], vec![1, 4]]);
    }
}
