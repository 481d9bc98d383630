// A constructed style sheet: it needs neither a file beside the bundle nor inline styles in the page.
const STYLE = `
.w3d { position: relative; width: 100%; height: 100%; min-height: 240px; overflow: hidden; background: #f3f5f7;
  font: 13px/1.35 system-ui, sans-serif; color: #16202a; touch-action: none; }
.w3d-none { display: grid; place-content: center; padding: 2rem; text-align: center; }
.w3d canvas { display: block; width: 100%; height: 100%; outline: none; cursor: grab; }
.w3d canvas:active { cursor: grabbing; }
.w3d canvas:focus-visible { box-shadow: inset 0 0 0 3px #0b62c4; }
.w3d canvas:focus-visible { outline: 3px solid #0b62c4; outline-offset: -3px; }
.w3d-labels { position: absolute; inset: 0; overflow: hidden; pointer-events: none; }
.w3d-labels[hidden] { display: none; }
.w3d-label { position: absolute; left: 0; top: 0; min-width: 26px; min-height: 26px; box-sizing: border-box; padding: 3px 7px; border: 1px solid #9aa7b4; border-radius: 5px;
  background: #ffffffd9; color: #16202a; font: inherit; text-align: left; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
.w3d-label[hidden] { display: none; }
span.w3d-label { border: 0; background: #ffffffb0; min-width: 0; min-height: 0; padding: 0 4px; }
button.w3d-label { pointer-events: auto; cursor: pointer; }
button.w3d-label:hover { background: #fff; border-color: #0b62c4; color: #16202a; }
button.w3d-label[aria-pressed="true"] { background: #fff4d6; border-color: #8a5a00; box-shadow: 0 0 0 1px #8a5a00; color: #16202a; }
.w3d-label > span { display: block; font-size: 12px; }
.w3d-brief:not(:hover, :focus-visible, [aria-pressed="true"]) > span { display: none; }
button.w3d-label:is(:hover, :focus-visible, [aria-pressed="true"]) { z-index: 1; }
.w3d-bad { border-color: #c43302; color: #8f2500; }
.w3d-bar { position: absolute; display: flex; flex-wrap: wrap; gap: 2px 4px; padding: 4px; border-radius: 7px;
  background: #ffffffe6; box-shadow: 0 1px 3px #0003; z-index: 20000; }
.w3d-views { top: 8px; left: 8px; max-width: calc(100% - 16px); }
.w3d-layers { bottom: 8px; left: 8px; max-width: calc(100% - 16px); }
.w3d-bar button { padding: 4px 9px; border: 1px solid transparent; border-radius: 5px; background: none; color: inherit;
  font: inherit; cursor: pointer; }
.w3d-bar button:hover { background: #e3eaf1; }
.w3d-bar label { display: flex; align-items: center; gap: 4px; padding: 3px 6px; cursor: pointer; }
.w3d-bar input { margin: 0; accent-color: #0b62c4; }
.w3d :is(button, input):focus-visible { outline: 3px solid #0b62c4; outline-offset: 1px; }
@media print { .w3d-bar { display: none; } }
`;
let adopted = false;

export function adoptStyle() {
  if (adopted) return;
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(STYLE);
  document.adoptedStyleSheets = [...document.adoptedStyleSheets, sheet];
  adopted = true;
}
