// Messages of the program, in which fields of the page stand for the command's options.
import { t } from "./base.js";

const OPTIONS = /--explain DIR|--[a-z]+(?:-[a-z]+)*/g;
const INSTEAD = {
  "--target": "option_target", "--length-unit": "option_length_unit", "--scanner": "option_scanner",
  "--tolerance": "option_tolerance", "--front": "option_front", "--columns": "option_columns", "--pitch": "option_pitch", "--vertical": "option_vertical", "--explain DIR": "found_why", "--hint": "found_again",
};
const NO_FIELD = /, or --front-point X,Y,Z near the front/g; // the front is chosen in the picture

/** The text of a failure with the page's fields in place of options, and the field that it names first. */
export function inWordsOfThePage(text) {
  const found = text.match(OPTIONS) ?? [];
  const words = text.replace(NO_FIELD, "").replace(OPTIONS, (option) => (INSTEAD[option] ? `“${t(INSTEAD[option])}”` : option));
  return { text: words, field: INSTEAD[found[0]]?.match(/^option_(.*)/)?.[1] };
}
