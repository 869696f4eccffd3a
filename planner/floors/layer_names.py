"""Meaning of a layer by its name: layer standards, and words of many languages.

AIA/NCS writes discipline and group (`A-WALL-FULL`); ISO 13567 and BS 1192 write a discipline and a code
of the CI/SfB or Uniclass table (`A-21----E-`, `A-210-M_Wall`); everybody else writes words of his language,
alone or in compounds. Words come before codes, and what is written on a thing before the thing: `DOOR-IDEN`
is text. Of several things the last one decides: `Stair Wall` is a wall; but doors and windows
are openings: `Doors/Windows`.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from functools import cache


@dataclass(frozen=True)
class LayerReading:
    """Meaning of a name, and the source of that meaning."""

    role: str
    """A role of LAYER_ROLES."""
    why: str


def reading_of(name: str) -> LayerReading | None:
    """Return the meaning of a layer or block by its name; None if the name is unknown."""
    return _reading(plain_name(name))


def _reading(plain: str) -> LayerReading | None:
    """Return the meaning by the first group of words that has one; within a group the last word decides."""
    for group in _GROUPS:
        found = [(match, role) for role, words in group for match in any_of(words).finditer(plain)]
        if {"doors", "windows"} <= {role for _, role in found}:
            return LayerReading("openings", "words for doors and for windows")
        if found:
            match, role = max(found, key=lambda item: (_word_end(plain, item[0]), item[0].end()))
            return LayerReading(role, f"the word {_whole_words(plain, match)}")
    return _by_code(plain)


def _word_end(plain: str, found: re.Match[str]) -> int:
    return plain.find(" ", found.end())


def _whole_words(plain: str, found: re.Match[str]) -> str:
    """Return the match, extended to whole words."""
    start = plain.rfind(" ", 0, found.start() + 1) + 1
    return plain[start : plain.find(" ", found.end())]


def plain_name(name: str) -> str:
    """Return a name in capitals without accents, words and numbers apart, one space around each."""
    apart = re.sub(r"(?<=[a-zà-ÿ])(?=[A-Z])", " ", name)
    return " " + " ".join(re.findall(r"[^\W\d_]+|[0-9]+", _bare(apart.upper()))) + " "


def _bare(text: str) -> str:
    spread = unicodedata.normalize("NFKD", text)
    return "".join(letter for letter in spread if not unicodedata.combining(letter))


@cache
def any_of(words: str) -> re.Pattern[str]:
    """Return a pattern that matches any of the words in a plain name; it is made at its first use.

    A word is whole, `x*` a beginning, `*x` an end; `+` joins words that follow.
    """
    return re.compile("|".join(_word(_bare(word)) for word in words.split()))


def _word(word: str) -> str:
    body = re.escape(word.strip("*").replace("+", " "))
    return f"{'' if word[0] == '*' else ' '}{body}{'' if word[-1] == '*' else '(?= )'}"


_NAMED = (
    "IDEN NAME NAMES NAMEN TEXT TEXTS TEXTE TXT"
    " TAG TAGS NO NR NUMB NUMBER NUM LABEL STEMPEL BEZ NOM NOMS NOMI NAAM"
)
_ROOM_WORDS = "ROOM ROOMS AREA SPACE RAUM ZIMMER PIECE PIECES LOCAL LOCAUX SALA SALAS VANI RUIMTE"
_ROOM_NAMES = (
    " ".join(f"{room}+{label}" for room in _ROOM_WORDS.split() for label in _NAMED.split())
    + " RAUMTEXT* RAUMNAME* RAUMSTEMPEL* RAUMNUMMER* RAUMBEZ* ROOMNAME* ROOMTAG* ROOMTEXT* ZIMMERNAME* "
    "RUIMTENAAM* "
    "RUIMTENAMEN 室名* 部屋名* 房间名* 房名* ЭКСПЛИКАЦ*"
)
_ROOM_LINES = " ".join(
    f"{room}+{line}"
    for room in _ROOM_WORDS.split()
    for line in ("BORDER*", "BOUND*", "OUTLINE*", "LINE", "LINES")
)
_WRITTEN = """
    DIM DIMS DIME DIMEN* COTA COTAS COTE COTES COTATION* QUOTE QUOTA QUOTAT* BEMASS* BEMASZ* MASSKETTE*
    MASSE MATEN MAATVOERING* MAATLIJN* MEDIDA* РАЗМЕР* 寸法* TEXT TEXTS TEXTE TEXTES TEXTO* TESTO TESTI
    TEKST* TXT *TEXT NOTE NOTES NOTAS ANNO ANNOT* BESCHRIFT* LABEL* LEGEND* LEYENDA* SCHRIFT* IDEN TAG
    TAGS SYMB SYMBOL* ТЕКСТ* 文字* TTLB TITLE* TITEL* CARTOUCHE* CARTIGLIO* CARIMBO* CAJETIN* STEMPEL*
    标注* *标注 尺寸* 文字* *文字 注释* 说明* 图框* 轴线* 轴号* 轴网* *轴线 BORDER* RAHMEN BLATTRAHMEN RAMKA*
    VIEWPORT* VIEW+PORT VPORT* VPRT DEFPOINTS NPLT NOPLOT REVISION* REVC KEYN
    NORTH* NORDPFEIL* GRID GRIDS GRIDLINE* AXIS AXES AXE AXEN ACHSE ACHSEN *ACHSEN *RASTER EJE EJES ASSE
    ASSI EIXO EIXOS STRAMIEN* CENTERLINE* CENTRELINE* CNTR CENTER ОСИ ОСЬ 通り芯* 芯*
"""
_NOT_ON_THE_FLOOR = """
    OVHD OVERHEAD* ABOVE OVERHANG* OVERBUILD* PROJECTION* PROYECCION* PROIEZION* PROJECAO HIDDEN HIDD
    VERDECKT* HEAD HEADER* ROOF ROOFS DACH *DACH TOIT TOITURE* TEJADO* CUBIERTA* TETTO COPERTURA* DAK
    TELHADO* TRUSS* RAFTER* КРЫШ* КРОВЛ* 屋根* CEIL CEILING* CLNG RCP DECKENSPIEGEL* ABHANGDECKE* PLAFOND*
    TECHO* SOFFITT* FORRO ПОТОЛ* 天井* FNDN FOUNDATION* FOOTING* FOOTER* STEM FUNDAMENT* FONDATION*
    CIMENT* CIMIENT* FONDAZION* FUNDACAO FUNDERING* JOIST* ФУНДАМЕНТ* 基礎* DEMO DEMOL* ABBRUCH* ABRISS*
    SLOOP* TOPO TOPOGRAPH* SITE TERRAIN* GELÄNDE TERRENO* PROP PROPERTY* PARCEL* SETBACK* ROAD*
    LANDSCAP* PLNT TREE* BAUM BÄUME ARBRE* ARBOL* PARK PARKING* BLDG+PADS CONTOUR* VEGETA* FENCE* LITE
    LIGHT* ELEC ELECTR* ELEKTR* POWR HVAC DUCT* LÜFTUNG* MECH PIPE* PIPING* SPRN SPRINK* ALARM* TELE
    COMM LEUCHT* STECKDOSE* IMPT 屋顶* 天花* 吊顶* 基础* 消防* 电气* 给排水* 暖通*
"""
_RAILINGS = """
    HRAL RAIL RAILS RAILING* HANDRAIL* GUARDRAIL* BALUSTRAD* GELÄNDER* GELAENDER* *GELAENDER BRÜSTUNG*
    BRUESTUNG* GARDE+CORPS GARDECORPS* RAMBARDE* BARANDA* BARANDILLA* RINGHIER* PARAPET* LEUNING*
    CORRIMAO GUARDA+CORPO ПЕРИЛ* ОГРАЖДЕН* 手すり* 栏杆* 扶手* PRHT
"""
_STAIRS = """
    STAIR* STRS STEPS TREPPE* *TREPPE *TREPPEN ESCALIER* ESCALERA* SCALA SCALE ESCADA* TRAP TRAPPEN RAMP
    RAMPS RAMPE RAMPA* EVTR ELEVATOR* LIFT AUFZUG* ASCENS* ЛЕСТНИЦ* 階段* 楼梯* 电梯* 台阶* 坡道*
"""
_FURNITURE = """
    FURN FURNITURE* FURNISH* MÖBEL* MOEBEL* *MÖBEL *MOEBEL MOBILIER* MEUBLE* MOBILIARIO* MUEBLE* MOBILI
    ARREDO* ARREDI MEUBILAIR* MEUBEL* CASE CASEWORK* CABINET* FIXT FIXTURE* SANR SANIT* APPL APPLIANCE*
    EQPM EQUIP*
    EINRICHT* PFIX PLUMB* SPCQ SHELF* SHELVES REGAL REGALE COUCH* SOFA SOFAS BENCH BENCHES МЕБЕЛ* САНТЕХ*
    家具* 什器* 衛生* 洁具* 设备*
"""
_PLACES = """
    KITCHEN* KÜCHE* KUECHE* CUISINE* COCINA* CUCINA* KEUKEN* COZINHA* BATH TOILET* WC
"""
_DOORS = """
    DOOR* *DOOR *DOORS DORS TÜR* TUER* *TÜR *TÜREN *TUER *TUEREN PORTE PORTES PUERTA* PORTA PORTAS
    PORTONE* DEUR DEUREN *DEUR *DEUREN DRZWI* ДВЕР* ドア* 扉* 门* *门 DR
"""
_OPENINGS = """
    OPENING* OPNG ÖFFNUNG* OEFFNUNG* BAIE BAIES OUVERTURE* ABERTURA* HUECO* APERTUR* INFISSI SERRAMENTI
    MENUISERIE* CARPINTERIA* ESQUADRIA* KOZIJN* ПРОЕМ* 建具* 開口* 门窗* *门窗 洞口* 门洞*
"""
_GLASS_WALLS = "CURTAIN+WALL* GLASS+WALL* GLAZED+WALL* GLASWAND* GLASWÄND* GLAS+WAND* MUR+RIDEAU"
_ON_WALLS = "WALL+MOUNT* WALL+HUNG WALL+MTD"
_WINDOWS = """
    WINDOW* *WINDOW *WINDOWS WNDW GLAZ GLAZING* GLASS GLAS VERGLASUNG* CURT CURTAIN* CRYSTAL* CRISTAL*
    VIDRO* VIDRIO* VETRO VETRI VITRAGE* FENSTER* *FENSTER FENÊTRE* VENTANA* FINESTR* JANELA* RAAM RAMEN
    BEGLAZING* CANCEL CANCELES MUR+RIDEAU WIN ОКН* ОКОН* ОСТЕКЛЕН* 窓* ガラス* 窗* *窗 玻璃*
"""
_COLUMNS = """
    COLUMN* COL COLS CLMN STÜTZE* STUETZE* *STÜTZE *STÜTZEN *STUETZE *STUETZEN SÄULE* SAEULE* PFEILER*
    PILLAR* POTEAU* PILIER* COLONNE* COLUMNA* PILAR* COLONNA PILASTR* KOLOM* КОЛОНН* 柱* *柱
"""
_BEAMS = """
    BEAM BEAMS GIRDER* UNTERZUG* TRÄGER* TRAEGER* *TRÄGER *TRAEGER POUTRE* VIGA* TRAVE TRAVI BALK BALKEN
    LIGGER* БАЛК* 梁*
"""
_WALLS = """
    WALL* *WALL *WALLS WL WLS PARTITION* PRTN WAND WÄNDE WAENDE *WAND *WÄNDE *WAENDE MAUER* *MAUER MUR
    MURS MURO* CLOISON* PARED PAREDES TABIQUE* PARETE* PARETI MURI MURATUR* TRAMEZZ* MUUR MUREN *MUUR
    *MUREN WANDEN *WANDEN PAREDE* ALVENARIA* DIVISÓRIA* ŚCIAN* VEGG* VÄGG* СТЕН* ПЕРЕГОРОД* 壁* 間仕切*
    墙* *墙 *墙体 *墙线 隔断*
"""
_DRAWN_OVER = """
    HATCH* *HATCH SCHRAFF* HACHUR* SOMBREAD* ACHURAD* TRAMA* RETINO* CAMPITUR* ARCERING* PATT PATTERN*
    ШТРИХОВ* 填充* *填充 FILL FILLS PDF DETL DETAIL* ELEV ELEVATION* ANSICHT* FACADE* ALZADO* PROSPETT* GEVEL*
    SECTION* SCHNITT* COUPE* PRZEKROJ* PRZEKRÓJ*
"""
_ROOMS = """
    ROOM ROOMS RAUM RÄUME RAEUME ZIMMER SPACE SPACES PIECES LOCAUX HABITACION* AMBIENTI VANI RUIMTE
    RUIMTEN COMODO* ПОМЕЩЕН* 部屋* 房间* AREA
"""
_FLOOR = """
    FLOOR FLOORS FLOR FLOORING* SLAB SLABS FOOTPRINT* FUSSBODEN* BODEN *BODEN DECKE BODENPLATTE* SOL
    SOLS DALLE* PLANCHER* SUELO* PISO PISOS FORJADO* SOLADO* PAVIMENT* SOLAIO* VLOER* *VLOER LAJE* ПОЛ
    ПЕРЕКРЫТ* 床* 楼板* 地面*
"""


_GROUPS = (
    (("names", _ROOM_NAMES), ("rooms", _ROOM_LINES)),
    (("ignore", _WRITTEN), ("ignore", _NOT_ON_THE_FLOOR)),
    (("windows", _GLASS_WALLS), ("furniture", _ON_WALLS)),
    (
        ("railings", _RAILINGS),
        ("stairs", _STAIRS),
        ("furniture", _FURNITURE),
        ("doors", _DOORS),
        ("openings", _OPENINGS),
        ("windows", _WINDOWS),
        ("columns", _COLUMNS),
        ("beams", _BEAMS),
        ("walls", _WALLS),
    ),
    (("ignore", _DRAWN_OVER),),
    (("rooms", _ROOMS),),
    (("furniture", _PLACES),),
    (("floor", _FLOOR),),
)
"""Roles by words. The first group with a word of the name counts, and its last word decides.

Storeys and places come last: they say where a thing is (`Wall - Kitchen`, `Walls Floor 1`).
"""


def _by_code(plain: str) -> LayerReading | None:
    """Codes of CI/SfB table 1 after a discipline (ISO 13567, BS 1192), or of Uniclass G."""
    found = re.match(r" [A-Z]{1,2} (?:[0-9] )?(G )?([0-9]{2,4}) ", plain)
    if found is None:
        return None
    name, table = ("Uniclass", _UNICLASS) if found.group(1) else ("CI/SfB", _CI_SFB)
    code = found.group(2)
    for part in (code[:3], code[:2], code[:1]):
        if part in table:
            return LayerReading(table[part], f"the code {part} of {name}")
    return None


_CI_SFB = {
    **dict.fromkeys(("315", "325", "32"), "doors"),
    **dict.fromkeys(("21", "22"), "walls"),
    **dict.fromkeys(("23", "43"), "floor"),
    **{"24": "stairs", "28": "columns", "31": "windows", "34": "railings"},
    **dict.fromkeys(("7", "8"), "furniture"),
    **dict.fromkeys(("1", "27", "35", "37", "45", "5", "6", "9"), "ignore"),
}
_UNICLASS = {
    **{"22": "floor", "23": "stairs", "25": "walls", "26": "columns", "31": "windows", "32": "doors"},
    **dict.fromkeys(("21", "24"), "ignore"),
}
