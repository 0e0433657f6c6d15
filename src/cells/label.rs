//! What a rover may do with a cell: its [`Label`]. No label at all is `Option::None`, on disk a null.

/// Whether a rover may cross a cell; its number is the value of `cells.label`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(i8)]
pub enum Label {
    Traversable = 0,
    Untraversable = 1,
}

impl Label {
    /// By number.
    pub const ALL: [Label; 2] = [Label::Traversable, Label::Untraversable];

    pub fn untraversable_if(condition: bool) -> Label {
        Label::ALL[usize::from(condition)]
    }

    pub fn is_untraversable(self) -> bool {
        self == Label::Untraversable
    }

    pub fn number(self) -> i8 {
        self as i8
    }

    /// The label with this number; `None` where no label has it.
    pub fn of_number(number: i8) -> Option<Label> {
        Label::ALL.into_iter().find(|label| label.number() == number)
    }

    /// Its place in lists with an entry a label.
    pub fn index(self) -> usize {
        self as usize
    }

    pub const fn name(self) -> &'static str {
        match self {
            Label::Traversable => "traversable",
            Label::Untraversable => "untraversable",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_numbers_are_those_on_disk_and_an_absent_label_costs_no_byte() {
        assert_eq!(Label::ALL.map(Label::number), [0, 1]);
        assert_eq!([-1, 0, 1, 2].map(Label::of_number), [None, Some(Label::ALL[0]), Some(Label::ALL[1]), None]);
        assert_eq!(Label::untraversable_if(true), Label::Untraversable);
        assert_eq!(size_of::<Option<Label>>(), 1);
    }
}
