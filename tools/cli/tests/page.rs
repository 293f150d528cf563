// SPDX-License-Identifier: MIT OR Apache-2.0
//! The page of `takt analyse` in a browser: it loads, and its script runs to the end and draws every operation.

use crate::common::{Folder, source};
use std::process::Command;

/// DOM of the page after its scripts have run, and the browser's console output.
fn open(folder: &Folder, page: &str) -> (String, String) {
    let profile = folder.path().join("profile");
    let output = Command::new("chromium")
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"])
        // The window is high enough for all rows, since only visible rows are drawn.
        .args(["--enable-logging=stderr", "--v=0", "--dump-dom", "--window-size=1300,16000"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("file://{}", folder.path().join(page).display()))
        .output()
        .expect("chromium is there: `cargo xtask test` installs it");
    let console = String::from_utf8_lossy(&output.stderr);
    let console = console.lines().filter(|line| line.contains("CONSOLE")).collect::<Vec<_>>().join("\n");
    (String::from_utf8_lossy(&output.stdout).into_owned(), console)
}

#[test]
fn the_page_opens_and_draws_every_operation() {
    let folder = Folder::new();
    folder.line(&format!("asm {} -m t1 -o image", source("tracking.s"))).ok();
    folder.line("analyse image --html page.html").ok();
    let json = folder.line("analyse image --json").ok();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let bundles = json["bundles"].as_array().unwrap();
    let stalls: usize = bundles.iter().map(|bundle| bundle["stalls"].as_array().unwrap().len()).sum();

    let (page, console) = open(&folder, "page.html");
    assert_eq!(console, "");
    assert!(page.contains(&format!("data-rows=\"{}\"", bundles.len())), "one operation for each bundle");
    assert!(page.contains(&format!("{} cycles, {} bundles</h1>", json["cycles"], bundles.len())));
    assert_eq!(page.matches("lost before cycle").count(), stalls + 1, "one in the script itself");
    assert_eq!(page.matches("class=\"tp-issue\"").count(), bundles.len());
    let critical = bundles.iter().flat_map(|bundle| bundle["operations"].as_array().unwrap());
    let critical = critical.filter(|one| one["critical"] == true).count();
    assert!(critical > 10 && page.matches("class=\"tp-critical\"").count() == critical, "{critical}");
    // An image contains names and texts of its sources.
    assert!(page.contains(">tracking.s</option>") && page.matches("data-line=").count() > 100);
    // The page loads nothing from elsewhere.
    let text = folder.read_text("page.html");
    assert!(!text.contains("src=") && !text.contains("href="));

    // Control: a script that fails is detected.
    folder.write("broken.html", text.replace("const D = ", "missing(); const D = "));
    let (page, console) = open(&folder, "broken.html");
    assert!(!page.contains("data-rows=\"") && console.contains("missing is not defined"), "{console}");
}

/// The page of a system: the cycles of each core equal those of its period, and link events are drawn.
#[test]
fn the_page_of_a_system_draws_all_cores_and_links() {
    let folder = Folder::new();
    let systems = format!("{}/../../programs/systems", env!("CARGO_MANIFEST_DIR"));
    let with = format!("{systems}/speed.toml --inputs {systems}/speed.csv");
    folder.line(&format!("analyse {with} --html page.html")).ok();
    let periods = folder.line(&format!("analyse {with} --json")).ok();
    let periods: serde_json::Value = serde_json::from_str(&periods).unwrap();
    let text = folder.read_text("page.html");
    assert!(!text.contains("src=") && !text.contains("href="));
    let data = text.split("id=\"data\">").nth(1).and_then(|rest| rest.split("</script>").next()).unwrap();
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    let cores = data["cores"].as_array().unwrap();
    assert_eq!(cores.len(), 3);
    for core in cores {
        // Cycles since the last tick.
        let tick = core["ticks"].as_array().unwrap().last().unwrap().as_u64().unwrap();
        let stretches = core["stretches"].as_array().unwrap().iter();
        let own = stretches.filter(|stretch| stretch[0].as_u64().unwrap() > tick);
        let cycles: u64 = own.map(|stretch| stretch[1].as_u64().unwrap()).sum();
        let known = &periods["cores"][core["name"].as_str().unwrap()]["periods"];
        let range = known["min"].as_u64().unwrap()..=known["max"].as_u64().unwrap();
        assert!(range.contains(&cycles), "{}: {cycles}, {range:?}", core["name"]);
    }
    let links = data["links"].as_array().unwrap();
    assert!(
        links.iter().any(|link| link["kind"] == "wire" && !link["events"].as_array().unwrap().is_empty())
    );

    let (page, console) = open(&folder, "page.html");
    assert_eq!(console, "");
    assert!(page.contains("data-drawn=\"") && !page.contains("data-drawn=\"0\""));
    for core in cores {
        assert!(page.contains(&format!(">{}</text>", core["name"].as_str().unwrap())), "{}", core["name"]);
    }
}

/// Hovering over an operation shows its details.
#[test]
fn hovering_shows_the_details() {
    let folder = Folder::new();
    folder.write(
        "mean.s",
        ".input a, b\n.output mean\n.period\n.reg sum\np:  fadd sum, a, b\n    fdiv mean, sum, 2.0\n    wait p\n",
    );
    folder.line("analyse mean.s -m f3 --html page.html").ok();
    let hover = "<script type=module>
        const over = (element) => {
            const box = element.getBoundingClientRect(), x = box.x + box.width / 2, y = box.y + 2;
            const found = document.elementFromPoint(x, y);
            found.dispatchEvent(new MouseEvent('mousemove', { bubbles: true, clientX: x, clientY: y }));
            const tip = document.querySelector('.tp-tip'), at = tip.getBoundingClientRect();
            const shown = tip.style.display === 'block' && at.right <= innerWidth && at.bottom <= innerHeight;
            document.body.append(`[${shown}: ${tip.textContent}]`);
        };
        over(document.querySelector('g[data-row=\"1\"] .tp-issue'));
        over(document.querySelector('.tp-stall'));
        over(document.querySelector('.tp-corner'));
        // A click leads to the line, and a line to its operations.
        document.querySelector('.tp-label[data-row=\"1\"]').click();
        const marked = () => [...document.querySelectorAll('.tp-marked')].map((one) => one.textContent);
        document.body.append(`[line ${document.querySelector('#text .on').dataset.line}: ${marked()}]`);
        document.querySelector('#text [data-line=\"5\"]').click();
        document.body.append(`[line ${document.querySelector('#text .on').dataset.line}: ${marked()}]`);
    </script>";
    let page = folder.read_text("page.html").replace("</body>", &format!("{hover}</body>"));
    folder.write("hover.html", page);
    let (page, console) = open(&folder, "hover.html");
    assert_eq!(console, "");
    let told: Vec<&str> =
        page.split("[true: ").skip(1).filter_map(|rest| rest.split_once(']')).map(|(told, _)| told).collect();
    let [operation, stall] = told[..] else { panic!("{page}") };
    assert!(
        operation.contains("fdiv mean")
            && operation.contains("mean.s:6")
            && operation.contains("result in cycle")
            && operation.contains("on the longest chain\n5 cycles of it: sum through add"),
        "{operation}"
    );
    assert!(stall.contains("operand") && stall.contains("awaits"), "{stall}");
    assert!(page.contains("[line 6: fdiv mean, sum,") && page.contains("[line 5: fadd sum, a, b]"), "{page}");
    assert!(page.contains("[false: "), "nothing is told where there is nothing");
    // Without reassembly, the column is missing.
    assert!(page.contains("<th>as it is</th>") && !page.contains("<th>reassembled</th>"));
    folder.line("analyse mean.s -m f3 --reassemble --html page.html").ok();
    assert!(open(&folder, "page.html").0.contains("<th>reassembled</th>"));
}

#[test]
fn names_cannot_leave_the_data() {
    let folder = Folder::new();
    // The path of a file is the only text in which a program can have arbitrary characters.
    let name = "</script><script>document.body.dataset.evil=1</script>.s";
    std::fs::create_dir_all(folder.path().join(name).parent().unwrap()).unwrap();
    folder.write(name, ".output y\n.period\np: mov y, zero\n wait p\n");
    let done = folder.takt(&["analyse", name, "--html", "page.html"]);
    assert_eq!(done.status, Some(0), "{done:?}");
    let (page, console) = open(&folder, "page.html");
    assert_eq!(console, "");
    assert!(page.contains("data-rows=\"2\"") && !page.contains("data-evil"));
}
