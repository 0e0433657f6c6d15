//! What a crash left -> whether anything is lost or mixed.

use std::fs;
use std::path::Path;

use crate::tasks::{Bench, CLASSIFY, EVALUATE, OLD, Task, run};
use crate::tree::{self, Tree};

/// What an undisturbed run of a task gives: what crashed runs are held against.
pub struct Bar {
    task: Task,
    /// All files behind it.
    tree: Tree,
    stdout: Vec<u8>,
    /// What each reader says of the corpus before and after the task; `None` where it is no task that builds.
    said: Option<[Vec<Said>; 2]>,
    /// All files before it.
    before: Tree,
}

/// What stands in the words of a failure by which somebody would learn from what is no corpus, or use what is no model.
pub const MIXED: &str = "mixed: ";

/// What a reader said: what it read, or that it refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Said {
    /// Its products and its standard output.
    Read(Tree),
    Refused {
        code: Option<i32>,
        why: String,
    },
}

/// Whoever reads a corpus, and what it is asked.
const READERS: [(&str, &str); 3] = [
    (
        "train",
        "train corpus --out probe --threads 1 --prefetch 0 --set network.hidden=[1] --set epochs=1 --set allow_few_rows=true",
    ),
    ("inspect", "inspect corpus"),
    ("verify", "verify corpus --threads 1"),
];

const INSPECT: usize = 1;

impl Bar {
    pub fn of(bench: &Bench, task: Task) -> Bar {
        let work = bench.fresh(task.start);
        let before = tree::promised(&work);
        let builds = matches!(task.arguments.split(' ').next(), Some("generate" | "finalize" | "verify"));
        let all = |_: usize| true;
        let said_before = builds.then(|| said(&work, all));
        let output = run(&work, task.arguments);
        assert!(output.status.success(), "{}: {}", task.name, String::from_utf8_lossy(&output.stderr));
        let tree = tree::promised(&work);
        let said = said_before.map(|before| [before, said(&work, all)]);
        if let Some([_, after]) = &said {
            assert!(after.iter().all(|said| matches!(said, Said::Read(_))), "{}: {after:?}", task.name);
        }
        Bar { task, tree, stdout: output.stdout, said, before }
    }

    /// Whether a run that says it is done gave the right products.
    pub fn done(&self, work: &Path, stdout: &str) -> Result<(), String> {
        // What others say there holds times.
        let is_report = [EVALUATE.name, CLASSIFY.name].contains(&self.task.name);
        if is_report && stdout.as_bytes() != self.stdout {
            return Err("exit 0 with other words on stdout".into());
        }
        tree::difference(&self.tree, &tree::promised(work)).map_or(Ok(()), |what| Err(format!("exit 0, but {what}")))
    }

    /// Whether those readers that `asked` picks say what they said before the task, or all what they say after it, or refuse with a
    /// command that helps; `with_cure`: which is run, too.
    pub fn readers(&self, work: &Path, asked: impl Fn(usize) -> bool, with_cure: bool) -> Result<(), String> {
        let Some([before, after]) = &self.said else { return self.model(work) };
        let chosen: Vec<usize> = (0..READERS.len()).filter(|&k| asked(k)).collect();
        let mut sides = [true, true];
        for (&k, said) in chosen.iter().zip(said(work, &asked)) {
            let (name, _) = READERS[k];
            match said {
                Said::Read(_) => {
                    sides = [sides[0] && said == before[k], sides[1] && said == after[k]];
                    if sides == [false, false] {
                        return Err(format!("{MIXED}{name} reads neither the corpus of before nor that of after"));
                    }
                }
                Said::Refused { code, why } => {
                    refusal(name, code, &why)?;
                    // Whoever learns is in the way of nobody: what it is told to run must help.
                    if k == 0 && with_cure {
                        self.cured(work, &why)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Whether the command that a refusal names leads to the corpus of before or that of after, as `inspect` reads it.
    fn cured(&self, work: &Path, why: &str) -> Result<(), String> {
        let (Some(cure), Some([before, after])) = (command_in(why), &self.said) else { return Ok(()) };
        let elsewhere = work.with_file_name("cured");
        let _ = fs::remove_dir_all(&elsewhere);
        tree::copy(work, &elsewhere);
        let output = run(&elsewhere, &cure);
        if !output.status.success() {
            let why = flat(&String::from_utf8_lossy(&output.stderr));
            return Err(format!("the cure `marsyard {cure}`: exit {:?}: {why}", output.status.code()));
        }
        let (_, inspect) = READERS[INSPECT];
        match ask(&elsewhere, inspect) {
            said if [&before[INSPECT], &after[INSPECT]].contains(&&said) => Ok(()),
            other => Err(format!("{MIXED}behind the cure `marsyard {cure}` inspect says {other:?}")),
        }
    }

    /// A model is there whole or not at all.
    fn model(&self, work: &Path) -> Result<(), String> {
        let name = "run/model.safetensors";
        match fs::read(work.join(name)) {
            Ok(bytes) if self.tree.get(name) != Some(&bytes) => {
                Err(format!("{MIXED}{name} is there, and not the model"))
            }
            _ => Ok(()),
        }
    }

    /// Whether the same command again ends with what an undisturbed run gives.
    pub fn again(&self, work: &Path) -> Result<(), String> {
        let output = run(work, self.task.arguments);
        if !output.status.success() {
            let why = flat(&String::from_utf8_lossy(&output.stderr));
            return Err(format!("the same command again: exit {:?}: {why}", output.status.code()));
        }
        let there = tree::promised(work);
        tree::difference(&self.tree, &there).map_or(Ok(()), |what| Err(format!("the same command again: {what}")))
    }

    /// Whether one who goes back to the config of before a growth is refused, or has the corpus of before, to the last file: at once, or
    /// where it is said that what lies beyond may go.
    pub fn back(&self, work: &Path) -> Result<(), String> {
        let elsewhere = work.with_file_name("back");
        let _ = fs::remove_dir_all(&elsewhere);
        tree::copy(work, &elsewhere);
        let mut output = run(&elsewhere, OLD);
        if !output.status.success() {
            refusal("the old config", output.status.code(), &String::from_utf8_lossy(&output.stderr))?;
            output = run(&elsewhere, &format!("{OLD} --discard-beyond"));
        }
        if !output.status.success() {
            return Err(format!("back to the old config: {}", flat(&String::from_utf8_lossy(&output.stderr))));
        }
        let there = tree::promised(&elsewhere);
        tree::difference(&self.before, &there).map_or(Ok(()), |what| Err(format!("back to the old config: {what}")))
    }
}

/// Asks those readers that `asked` picks.
fn said(work: &Path, asked: impl Fn(usize) -> bool) -> Vec<Said> {
    let picked = READERS.iter().enumerate().filter(|(k, _)| asked(*k));
    picked.map(|(_, (_, arguments))| ask(work, arguments)).collect()
}

fn ask(work: &Path, arguments: &str) -> Said {
    let output = run(work, arguments);
    let probe = work.join("probe");
    let mut products = tree::promised(&probe);
    let _ = fs::remove_dir_all(&probe);
    products.insert("stdout".into(), output.stdout);
    match output.status.success() {
        true => Said::Read(products),
        false => {
            Said::Refused { code: output.status.code(), why: String::from_utf8_lossy(&output.stderr).into_owned() }
        }
    }
}

/// A refusal is an exit code that the program knows, and words that say what helps.
pub fn refusal(who: &str, code: Option<i32>, why: &str) -> Result<(), String> {
    let why = flat(why);
    if !matches!(code, Some(1 | 2 | 75)) {
        return Err(format!("{who}: exit {code:?}: {why}"));
    }
    let helps = ["marsyard ", "the same command", "--resume", "raise `scenes`", "help: "];
    if helps.iter().any(|word| why.contains(word)) {
        return Ok(());
    }
    let end: String = why.chars().skip(why.chars().count().saturating_sub(250)).collect();
    Err(format!("{who} says nothing that helps, exit {code:?}: {end}"))
}

/// The arguments of the first command of marsyard's that a message says to run; a verb alone is named, not said to run.
fn command_in(why: &str) -> Option<String> {
    let why = flat(why);
    let (_, command) = why.split_once("`marsyard ").filter(|(_, command)| !command.starts_with("generate`"))?;
    command.split_once('`').map(|(arguments, _)| arguments.to_owned())
}

/// A message without the line breaks and bars that stand in it for people.
pub fn flat(text: &str) -> String {
    let words = text.split_whitespace().filter(|word| !matches!(*word, "│" | "|" | "×" | "╰─▶" | "├─▶"));
    words.collect::<Vec<_>>().join(" ")
}
