// Messages of the program, in which fields of the page stand for the command's options.
import { language, t } from "./base.js";

const OPTIONS = /--explain DIR|--[a-z]+(?:-[a-z]+)*/g;
const INSTEAD = {
  "--target": "option_target", "--length-unit": "option_length_unit", "--scanner": "option_scanner",
  "--tolerance": "option_tolerance", "--front": "option_front", "--columns": "option_columns", "--pitch": "option_pitch", "--vertical": "option_vertical", "--explain DIR": "found_why", "--hint": "found_again",
};
const NO_FIELD = /, or --front-point X,Y,Z near the front/g; // the front is chosen in the picture

/** The text of a failure with the page's fields, and the field that it names first. In English the fields stand in
 *  place of options; a page in another language names them after the English sentence, in one of its own. */
export function inWordsOfThePage(text) {
  const found = text.match(OPTIONS) ?? [];
  const plain = text.replace(NO_FIELD, "");
  const nameOf = (option) => `“${t(INSTEAD[option])}”`;
  const fields = [...new Set(plain.match(OPTIONS))].filter((option) => INSTEAD[option]).map((option) => `${option}: ${nameOf(option)}`);
  const after = fields.length ? `${plain.replace(/\.?$/, ".")} ${t("fields_here", { fields: fields.join(", ") })}` : plain;
  const words = language === "en" ? plain.replace(OPTIONS, (option) => (INSTEAD[option] ? nameOf(option) : option)) : after;
  return { text: words, field: INSTEAD[found[0]]?.match(/^option_(.*)/)?.[1] };
}
