"""Words by which a text names a room, in several languages."""

from __future__ import annotations

import re
import unicodedata
from functools import cache

_HOME = """
    BED BEDROOM* BEDRM BATH BATHROOM* BATHRM SHOWER TOILET* WC WASHROOM* KITCHEN* KITCHENETTE PANTRY LIVING
    LIVINGROOM LOUNGE DINING DINETTE WARDROBE* CLOSET* LAUNDRY ENSUITE
    SCHLAF* KINDERZIMMER* WOHN* ESSZIMMER* KÜCHE* KUECHE* BAD BADEZIMMER* DUSCHE* GÄSTEZIMMER* ABSTELLRAUM
    CHAMBRE* CUISINE* SALON SEJOUR* BAIN BAINS TOILETTES CELLIER DOUCHE BUANDERIE
    DORMITORIO* RECAMARA* ALCOBA* HABITACION* COCINA* BAÑO BAÑOS SALA COMEDOR LAVANDERIA
    CAMERA CUCINA BAGNO SOGGIORNO PRANZO RIPOSTIGLIO
    QUARTO* COZINHA* BANHEIRO* SUITE
    SLAAPKAMER* WOONKAMER* KEUKEN* BADKAMER* BERGING
    SOVEVÆRELSE* KØKKEN* BADEVÆRELSE* STUE SOVRUM* KÖK BADRUM* VARDAGSRUM*
    SYPIALNIA KUCHNIA ŁAZIENKA POKÓJ YATAK MUTFAK BANYO СПАЛЬНЯ КУХНЯ ВАННАЯ САНУЗЕЛ
    寝室 台所 浴室 居間 玄関 洗面* 和室 洋室 トイレ 便所 キッチン LDK DK
"""
_WORK = """
    ROOM OFFICE* CORRIDOR* HALL HALLWAY* LOBBY RECEPTION* STORE STORAGE STOREROOM* MEETING CONFERENCE
    CLASSROOM* WORKSHOP* LAB LABORATORY GARAGE* ENTRY ENTRANCE FOYER STUDY LIBRARY ARCHIVE* SERVER*
    STAIRS STAIRCASE
    BÜRO* BUERO* FLUR* GANG DIELE LAGER* KELLER* WERKSTATT* BESPRECHUNG* EMPFANG EINGANG* TECHNIK* SERVERRAUM
    BUREAU* COULOIR* ENTREE DEGAGEMENT HALLE ATELIER* OFICINA* PASILLO* DEPOSITO* ALMACEN* VESTIBULO
    UFFICIO CORRIDOIO INGRESSO GARAGEM CORREDOR ESCRITÓRIO KANTOOR* HAL ZOLDER
    VÆRKSTED* KONTOR* LAGERRUM FÆLLESRUM* SERVERRUM* ENTRÉ 廊下 事務室 会議室 倉庫 КОРИДОР КАБИНЕТ
"""


@cache
def _pattern(words: str) -> re.Pattern[str]:
    each = sorted({_bare(word) for word in words.split()})
    ends = [re.escape(word.rstrip("*")) + (r"\w*" if word.endswith("*") else "") for word in each]
    return re.compile(rf"(?<![^\W\d_])(?:{'|'.join(ends)})(?![^\W\d_])", re.IGNORECASE)


def _bare(text: str) -> str:
    """The text without accents."""
    spread = unicodedata.normalize("NFKD", text)
    return "".join(letter for letter in spread if not unicodedata.combining(letter))


_ANYWHERE = _HOME + _WORK
_LONGEST = 60
"""Texts longer than this are notes, not names."""


def names_a_room(text: str, *, at_home: bool = False) -> bool:
    """Return True if a text names a room; with `at_home`, one that dwellings have, such as a kitchen."""
    if len(text) > _LONGEST:
        return False
    return bool(_pattern(_HOME if at_home else _ANYWHERE).search(_bare(text)))
