//! Which values of a scene's tools are in range.

use std::path::PathBuf;

use super::check::Check;
use crate::SimError;
use crate::scene::{AblationEntry, GrabHold, Key, LoadEntry, PressureKey, ToolEntry};

/// The farthest a path goes in each axis, m.
pub(crate) const FARTHEST_M: f64 = 1e3;

/// The largest pressure, Pa: where even the stiffest of tissues is no solid any more.
const MOST_PA: f64 = 1e12;

/// The largest force, N, and torque, N m: that pressure on a square metre.
const MOST_N: f64 = 1e12;

impl Check<'_> {
    pub fn tool(&self, tool: &ToolEntry, key: &str) -> Result<(), SimError> {
        match tool {
            ToolEntry::Grab(grab) => {
                self.region(&grab.region, &format!("{key}.region"))?;
                if let Some(stiffness) = grab.stiffness_n_m4 {
                    let key = format!("{key}.stiffness_n_m4");
                    self.positive(&key, stiffness)?;
                    let want = "no such key unless hold is \"pad\"";
                    self.that(grab.hold == GrabHold::Pad, &key, stiffness, want)?;
                }
                self.path(&grab.path, grab.path_csv.as_ref(), key)?;
                self.axis(&grab.turn_axis, &format!("{key}.turn_axis"))?;
                if let Some(begin) = grab.begin_s {
                    let key = format!("{key}.begin_s");
                    let want = "no such key unless hold is \"mean\"";
                    self.that(grab.hold == GrabHold::Mean, &key, begin, want)?;
                }
                self.acts(grab.begin_s, grab.release_s, key)
            }
            ToolEntry::Probe(probe) => {
                let radius = probe.radius_m;
                let (way, centre) = probe.start(self.place, key)?;
                self.vector(&format!("{key}.centre{}", way.suffix()), &centre)?;
                self.positive(&format!("{key}.radius_m"), radius)?;
                if let Some(spacing) = probe.spacing_m {
                    let key = format!("{key}.spacing_m");
                    self.positive(&key, spacing)?;
                    let want = format!("at most the radius, {radius:?}");
                    self.that(spacing <= radius, &key, spacing, &want)?;
                }
                self.path(&probe.path, probe.path_csv.as_ref(), key)?;
                self.acts(probe.begin_s, probe.release_s, key)
            }
            ToolEntry::Pressure(pressure) => {
                self.region(&pressure.region, &format!("{key}.region"))?;
                self.pressure(&pressure.pressure, key)
            }
            ToolEntry::Load(load) => self.load(load, key),
            ToolEntry::Resect(one) => {
                let want = "no such key for resect, which leaves void";
                self.that(one.becomes.is_none(), &format!("{key}.becomes"), one.becomes, want)?;
                self.ablation(one, key)
            }
            ToolEntry::Coagulate(one) => {
                let want = "the label of what the material becomes";
                self.that(one.becomes.is_some(), &format!("{key}.becomes"), one.becomes, want)?;
                self.ablation(one, key)
            }
            ToolEntry::Suture(one) => {
                let want = "no such key for suture, which changes no label";
                self.that(one.becomes.is_none(), &format!("{key}.becomes"), one.becomes, want)?;
                self.that(one.labels.is_empty(), &format!("{key}.labels"), &one.labels, want)?;
                self.ablation(one, key)
            }
            ToolEntry::Scalpel(one) => {
                let (way, centre) = one.start(self.place, key)?;
                self.vector(&format!("{key}.centre{}", way.suffix()), &centre)?;
                self.axis(&one.edge_m, &format!("{key}.edge_m"))?;
                if let Some(toughness) = one.toughness_j_m2 {
                    self.positive(&format!("{key}.toughness_j_m2"), toughness)?;
                }
                self.path(&one.path, one.path_csv.as_ref(), key)?;
                self.acts(one.begin_s, one.release_s, key)
            }
        }
    }

    fn ablation(&self, one: &AblationEntry, key: &str) -> Result<(), SimError> {
        let (way, centre) = one.start(self.place, key)?;
        self.vector(&format!("{key}.centre{}", way.suffix()), &centre)?;
        self.positive(&format!("{key}.radius_m"), one.radius_m)?;
        let want = "other labels than 0, which is void already";
        self.that(!one.labels.contains(&0), &format!("{key}.labels"), &one.labels, want)?;
        self.path(&one.path, one.path_csv.as_ref(), key)?;
        self.acts(one.begin_s, one.release_s, key)
    }

    fn path(&self, path: &[Key], csv: Option<&PathBuf>, key: &str) -> Result<(), SimError> {
        let from_file = csv.is_some();
        if from_file {
            let want = "no such key beside path_csv: a path is given once";
            return self.that(path.is_empty(), &format!("{key}.path"), path, want);
        }
        let want = "at least one entry { time_s, move_m, turn_deg }, or path_csv in its place";
        self.that(!path.is_empty(), &format!("{key}.path"), path, want)?;
        let mut last = f64::NEG_INFINITY;
        for (i, Key { time_s, move_m, turn_deg }) in path.iter().enumerate() {
            let key = format!("{key}.path[{i}]");
            last = self.later(*time_s, last, &key)?;
            self.vector(&format!("{key}.move_m"), move_m)?;
            let near = move_m.iter().all(|x| x.abs() <= FARTHEST_M);
            self.that(near, &format!("{key}.move_m"), move_m, "at most 1000 m in each axis")?;
            self.finite(&format!("{key}.turn_deg"), *turn_deg)?;
        }
        Ok(())
    }

    /// The time of an entry, which follows `last`.
    fn later(&self, time_s: f64, last: f64, key: &str) -> Result<f64, SimError> {
        self.finite(&format!("{key}.time_s"), time_s)?;
        let want = format!("more than the time before it, {last:?}");
        self.that(time_s > last, &format!("{key}.time_s"), time_s, &want)?;
        Ok(time_s)
    }

    pub fn axis(&self, axis: &[f64; 3], key: &str) -> Result<(), SimError> {
        self.vector(key, axis)?;
        // The square of a smaller axis underflows, and its direction with it.
        let long = axis.iter().any(|x| x.abs() > 1e-100) && axis.iter().all(|x| x.abs() < 1e100);
        self.that(long, key, axis, "an axis of a length other than 0, below 1e100")
    }

    /// From when to when a tool acts.
    fn acts(
        &self,
        begin_s: Option<f64>,
        release_s: Option<f64>,
        key: &str,
    ) -> Result<(), SimError> {
        let is_time = begin_s.is_none_or(|begin| begin >= 0.0 && begin.is_finite());
        let want = "a finite time, at least 0, or no such key";
        self.that(is_time, &format!("{key}.begin_s"), begin_s, want)?;
        let begin = begin_s.unwrap_or(0.0);
        let later = release_s.is_none_or(|release| release > begin && release.is_finite());
        let want = "a finite time after the start (after begin_s), or no such key";
        self.that(later, &format!("{key}.release_s"), release_s, want)
    }

    fn pressure(&self, keys: &[PressureKey], key: &str) -> Result<(), SimError> {
        let want = "at least one entry { time_s, pressure_pa }";
        self.that(!keys.is_empty(), &format!("{key}.pressure"), keys, want)?;
        let mut last = f64::NEG_INFINITY;
        for (i, PressureKey { time_s, pressure_pa }) in keys.iter().enumerate() {
            let key = format!("{key}.pressure[{i}]");
            last = self.later(*time_s, last, &key)?;
            let bearable = pressure_pa.abs() <= MOST_PA;
            let want = "at most 1e12 either way";
            self.that(bearable, &format!("{key}.pressure_pa"), pressure_pa, want)?;
        }
        Ok(())
    }

    fn load(&self, entry: &LoadEntry, key: &str) -> Result<(), SimError> {
        let LoadEntry { region, at_mm, load } = entry;
        if let Some(at) = at_mm {
            let key = format!("{key}.at_mm");
            self.vector(&key, at)?;
            let want = "no such key beside region: a load acts in one place";
            self.that(region.is_none(), &key, at, want)?;
        } else {
            let want = "where it acts, or at_mm, a point of the material, in its place";
            let key = format!("{key}.region");
            self.region(self.given(region.as_ref(), &key, want)?, &key)?;
        }
        let has_force = load.iter().any(|at| at.force_n.or(at.torque_n_m).is_some());
        let has_any = has_force || load.iter().any(|at| at.traction_pa.is_some());
        let want = "force_n, torque_n_m or traction_pa in at least one entry";
        self.that(has_any, &format!("{key}.load"), load, want)?;
        let mut last = f64::NEG_INFINITY;
        for (i, at) in load.iter().enumerate() {
            let key = format!("{key}.load[{i}]");
            last = self.later(at.time_s, last, &key)?;
            for (name, value, most) in [
                ("force_n", at.force_n, MOST_N),
                ("torque_n_m", at.torque_n_m, MOST_N),
                ("traction_pa", at.traction_pa, MOST_PA),
            ] {
                let Some(value) = value else { continue };
                let key = format!("{key}.{name}");
                self.vector(&key, &value)?;
                let bearable = value.iter().all(|x| x.abs() <= most);
                self.that(bearable, &key, value, "at most 1e12 in each axis")?;
                let alone = name != "traction_pa" || !has_force;
                let want = "no such key beside force_n or torque_n_m: a load is one or the other";
                self.that(alone, &key, value, want)?;
                let want = "no such key beside at_mm: a point bears a force alone";
                self.that(name == "force_n" || at_mm.is_none(), &key, value, want)?;
            }
        }
        Ok(())
    }
}
