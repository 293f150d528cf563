// The book in a real browser: `cargo xtask book --test`.
import assert from "node:assert/strict";
import { createReadStream, existsSync, readFileSync, readdirSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { after, before, test } from "node:test";
import { chromium } from "playwright-core";

const SITE = process.env.TAKT_BOOK;
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml" };
/** Folder of the host in which the site lies: its links must be relative. */
const PLACE = "/some/where/";
/** Time limit in a browser on a busy machine; ms. */
const PATIENCE = 120_000;

let server, browser, page, address;
const failed = [];

before(async () => {
  assert.ok(SITE, "TAKT_BOOK says where the book is: `cargo xtask book --test` sets it");
  server = createServer((request, response) => {
    const path = normalize(decodeURIComponent(new URL(request.url, "http://x").pathname)).replace(/\/$/, "/index.html");
    const file = join(SITE, path.slice(PLACE.length));
    if (!path.startsWith(PLACE) || !existsSync(file)) return response.writeHead(404).end();
    response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream" });
    createReadStream(file).pipe(response);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  address = `http://127.0.0.1:${server.address().port}${PLACE}`;
  browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
  page = await browser.newPage({ viewport: { width: 1300, height: 900 } });
  page.setDefaultTimeout(PATIENCE);
  page.on("pageerror", (error) => failed.push(error.message));
  page.on("response", (response) => response.status() >= 400 && failed.push(response.url()));
}, { timeout: PATIENCE });

after(async () => {
  await browser?.close();
  server?.close();
});

const limit = { timeout: 10 * PATIENCE };

test("the search finds a document by its words", limit, async () => {
  for (const [words, found] of [["initiation interval", "Glossary"], ["PID", "A PID controller"]]) {
    await page.goto(address);
    await page.keyboard.press("s");
    await page.keyboard.type(words);
    await page.locator("#mdbook-searchresults a, #searchresults a", { hasText: found }).first().waitFor();
  }
  assert.deepEqual(failed, []);
});

test("the book begins with its title page, and listings are coloured", limit, async () => {
  await page.goto(address);
  assert.equal(await page.locator("main h1").first().textContent(), "Takt");
  await page.locator("main a", { hasText: "Your first controller" }).first().click();
  await page.locator("main h1", { hasText: "Your first controller" }).waitFor();
  const listing = page.locator("code.language-takt").first();
  const colours = await listing.locator("span").evaluateAll((words) => [...new Set(words.map((word) => getComputedStyle(word).color))]);
  assert.ok(colours.length >= 4, colours.join("; "));
  assert.equal(await page.locator(".to-playground").getAttribute("target"), "_blank");
  assert.deepEqual(failed, []);
});

test("every listing opens in the playground by a click, and assembles there", limit, async () => {
  const listings = readdirSync(SITE).filter((name) => name.endsWith(".html") && name !== "print.html").flatMap((name) => {
    const links = [...readFileSync(join(SITE, name), "utf8").matchAll(/class="playground-link"[^>]* href="([^"]+)"/g)];
    return links.map(([, href]) => ({ name, hash: href.slice(href.indexOf("#")) }));
  });
  assert.ok(listings.length > 5, `${listings.length} listings`);
  const done = () => page.waitForFunction(() => document.body.dataset.ready !== undefined && !document.getElementById("assemble").disabled);
  // Open the first listing by its link, as a reader does; the others in the same page.
  await page.goto(address + listings[0].name);
  const book = page;
  [page] = await Promise.all([book.context().waitForEvent("page"), book.locator(".playground-link").first().click()]);
  page.setDefaultTimeout(PATIENCE);
  page.on("pageerror", (error) => failed.push(error.message));
  await page.waitForSelector("body[data-ready]");
  assert.equal(new URL(await page.locator("#home").evaluate((link) => link.href)).pathname, `${PLACE}index.html`, "beside the book, the page leads there");
  assert.equal(new URL(book.url()).pathname, `${PLACE}${listings[0].name}`, "the book stays open");
  for (const { name, hash } of listings) {
    await page.evaluate((hash) => {
      if (location.hash === hash) return;
      takt.state.program = null;
      location.hash = hash;
    }, hash);
    await page.waitForFunction(() => takt.state.program);
    await done();
    const { assembled, text } = await page.evaluate(() => takt.state.program);
    assert.ok(assembled, `${name}: ${text}`);
    assert.equal(await page.evaluate(() => document.getElementById("notice").hidden), true, name);
  }
  assert.deepEqual(failed, []);
});
